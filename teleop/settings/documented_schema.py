"""Add the docstrings of attributes to a JSON schema, as descriptions.

pydantic can do this (`use_attribute_docstrings`), but would parse the source of all classes at
their import, which takes longer than the rest of the import. Only the schema needs the docstrings.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from itertools import pairwise

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import DataclassSchema


def attribute_docstrings(cls: type) -> dict[str, str]:
    """The docstrings of the attributes that a class defines, by the names of the attributes.

    There are none if the source of the class is not installed.
    """
    try:
        source = inspect.getsource(cls)
    except (OSError, TypeError):
        return {}
    (defined,) = ast.parse(textwrap.dedent(source)).body
    assert isinstance(defined, ast.ClassDef)
    return {
        attribute.target.id: inspect.cleandoc(text.value.value)
        for attribute, text in pairwise(defined.body)
        if isinstance(attribute, ast.AnnAssign)
        and isinstance(attribute.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


class DocumentedSchema(GenerateJsonSchema):
    """Creates a JSON schema with the docstrings of the attributes of dataclasses."""

    def dataclass_schema(self, schema: DataclassSchema) -> JsonSchemaValue:
        """Return the JSON schema of a dataclass."""
        made = super().dataclass_schema(schema)
        fields = getattr(schema["cls"], "__pydantic_fields__", {})
        for name, text in attribute_docstrings(schema["cls"]).items():
            key = (name in fields and fields[name].alias) or name
            if shown := made["properties"].get(key):
                shown.setdefault("description", text)
        return made
