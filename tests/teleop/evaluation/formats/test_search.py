"""Which files of a folder are taken for measurements."""

from __future__ import annotations

import pytest

from teleop.evaluation.formats.search import is_measurement

SAMPLES = "Time [s],Position [mm],Force [N]\n0,1,2\n0.1,2,3\n"


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.csv", SAMPLES, True),
        ("a.TXT", SAMPLES, True),
        ("empty.csv", "", True),  # a failed measurement is reported by the evaluation
        ("a.xls", SAMPLES, True),  # as testing machines write text
        ("README.txt", SAMPLES, False),
        ("a.py", "print(1)", False),
        ("a.json", "{}", False),
        ("a.h5", b"\x89HDF\r\n", True),
        ("a.mcap", b"\x89MCAP0\r\n", True),
        ("a.mcap", b"", False),
        ("a.xlsx", b"PK\x03\x04", True),
        ("a.docx", b"PK\x03\x04", False),
        ("table.csv", "file,subject,method,kind of k,k [N/m]\n", False),
        ("trials.csv", "\ufefftrial,cube,repetition,estimator,k [N/m]\n", False),
        ("results.csv", "point,gain,repetition,estimator,error\n", False),
        ("estimates.csv", "Time [s],Displacement [m],Velocity [m/s],Excitation [-]\n", False),
        ("table-anova.csv", "response,source,degrees,error_degrees,f\n", False),
        ("table-repeatability.csv", "response,quantity,value,low,high\n", False),
    ],
)
def test_a_measurement_is_recognised_by_its_beginning_and_its_name(
    tmp_path, name, content, expected
):
    data = content if isinstance(content, bytes) else content.encode()
    (tmp_path / name).write_bytes(data)
    assert is_measurement(tmp_path / name) is expected


def test_only_a_folder_with_the_description_of_a_ros_bag_is_a_measurement(tmp_path):
    assert not is_measurement(tmp_path)
    (tmp_path / "metadata.yaml").touch()
    assert is_measurement(tmp_path)
