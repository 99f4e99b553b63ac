"""A package, so that all tests of the page in a worker use one browser (scope `package`)."""
