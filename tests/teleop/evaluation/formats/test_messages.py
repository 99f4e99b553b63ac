"""ROS bags and MCAP files of other programs."""

from __future__ import annotations

import json

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.formats.messages import fields_of, seconds_of
from teleop.evaluation.reading.signals import read_signals

START = 1_700_000_000_000_000_000
"""When the messages were recorded [ns]."""
JOINT = "/joint_states.position[0]=m"


def times(motion):
    return [START + round(t * 1e9) for t in motion.t]


def write_bag(writer_class, path, store, motion, **options):
    """A bag with the force on one topic, and the position on another, 2 ms later."""
    types = store.types
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
    sequence = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}
    pack = store.serialize_ros1 if sequence else store.serialize_cdr

    def head(ns):
        return header(stamp=stamp(ns // 10**9, ns % 10**9), frame_id="tip", **sequence)

    with writer_class(path, **options) as writer:
        names = ("geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState")
        force = writer.add_connection("/ft", names[0], typestore=store)
        joint = writer.add_connection("/joint_states", names[1], typestore=store)
        for ns, x, f in zip(times(motion), motion.x, motion.f, strict=True):
            message = types[names[0]](head(ns), wrench(vector(0.0, 0.0, f), vector(0.0, 0.0, 0.0)))
            writer.write(force, ns + 500, pack(message, names[0]))
            message = types[names[1]](head(ns), ["tip"], np.array([x]), np.array([]), np.array([]))
            writer.write(joint, ns + 900, pack(message, names[1]))
    return path


@pytest.fixture(params=["ros1", "sqlite3", "mcap"])
def bag(request, tmp_path, motion):
    pytest.importorskip("rosbags")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    if request.param == "ros1":
        store = get_typestore(Stores.ROS1_NOETIC)
        return write_bag(rosbag1.Writer, tmp_path / "data.bag", store, motion)
    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = {"sqlite3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}[
        request.param
    ]
    folder = tmp_path / "data"
    return write_bag(rosbag2.Writer, folder, store, motion, version=9, storage_plugin=plugin)


def test_fields_of_two_topics_of_a_bag_are_columns(bag, motion):
    signals = motion.same(read_signals(bag, position=JOINT, force="/ft.wrench.force.z"))
    assert signals.position_name == "/joint_states.position[0]"
    assert signals.notes == ("/joint_states interpolated at the times of /ft",)
    motion.same(read_signals(bag, position="position[0]=m", force="wrench.force.z"))


def test_the_fields_of_a_bag_are_listed_with_their_units(bag, refused):
    message = refused("estimate", bag)
    assert "no position column" in message
    assert "'/ft.wrench.force.z'" in message
    assert "'/joint_states.position[0]'" in message
    assert "(in s, N, N, N, N m, N m, N m, -)" in message
    message = refused("estimate", bag, "--topic", "/joint_states")
    assert "columns: 'time', 'position[0]' (in s, -)" in message
    message = refused("estimate", bag, "--topic", "/none")
    assert "no topic '/none': expected one of '/ft', '/joint_states'" in message


def test_a_bag_without_its_library_is_refused_in_one_line(bag, refused, without):
    without("rosbags")
    assert "a ROS bag needs rosbags: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", bag
    )


def test_a_damaged_bag_is_refused_in_one_line(tmp_path, refused):
    pytest.importorskip("rosbags")
    path = tmp_path / "data.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + bytes(300))
    assert "data.bag: cannot be read as a ROS bag" in refused("estimate", path)


ROS2_SAMPLE = """std_msgs/Header header
float64 position_mm
float64 force
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@pytest.fixture
def ros2_mcap(tmp_path, motion):
    pytest.importorskip("mcap_ros2")
    from mcap_ros2.writer import Writer

    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("lab_msgs/msg/Sample", ROS2_SAMPLE)
        for i, (ns, x, f) in enumerate(zip(times(motion), motion.x, motion.f, strict=True)):
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            message = {
                "header": {"stamp": stamp, "frame_id": ""},
                "position_mm": x * 1e3,
                "force": f,
            }
            writer.write_message("/samples", schema, message, START + i, START + i, i)
        writer.finish()
    return path


@pytest.fixture
def json_mcap(tmp_path, motion):
    from mcap.writer import Writer

    def write(encoding="json", stamp=None, **options):
        path = tmp_path / "json.mcap"
        with path.open("wb") as file:
            writer = Writer(file, **options)
            writer.start()
            schema = writer.register_schema("Sample", "jsonschema", b"{}")
            channel = writer.register_channel("/samples", encoding, schema)
            for ns, x, f in zip(times(motion), motion.x, motion.f, strict=True):
                sample = {"tip": {"position_mm": x * 1e3}, "force_N": f, "text": "a"}
                if stamp:
                    parts = zip(stamp, divmod(ns, 10**9), strict=True)
                    sample["header"] = {"stamp": dict(parts)}
                data = json.dumps(sample).encode()
                writer.add_message(channel, START if stamp else ns, data, ns)
            writer.finish()
        return path

    return write


def test_an_mcap_file_of_ros_2_messages_is_read_with_the_stamps_of_their_headers(
    ros2_mcap, motion, capsys
):
    motion.same(read_signals(ros2_mcap, force="force=N"))
    assert main(["estimate", str(ros2_mcap), "--force", "force=N", "--json"]) == 0
    fit = json.loads(capsys.readouterr().out)["least_squares"]
    assert fit["k"] == pytest.approx(2000.0, rel=1e-3)


@pytest.mark.parametrize("use_chunking", [True, False])
def test_an_mcap_file_of_json_messages_is_read(json_mcap, motion, use_chunking, capsys):
    path = json_mcap(use_chunking=use_chunking)
    motion.same(read_signals(path))
    assert main(["estimate", str(path)]) == 0


@pytest.mark.parametrize("stamp", [("sec", "nanosec"), ("secs", "nsecs")])
def test_json_messages_have_the_times_of_their_headers(json_mcap, motion, stamp):
    motion.same(read_signals(json_mcap(stamp=stamp)))


@pytest.mark.parametrize("seconds", [float("nan"), float("inf"), "5", None])
def test_a_json_stamp_without_whole_seconds_is_not_a_time(seconds):
    stamp = {"sec": seconds, "nanosec": 0}
    assert seconds_of(stamp) is None
    assert ("stamp", "nanosec") in fields_of({"stamp": stamp}, ())


def test_a_message_without_the_stamp_that_the_first_has_is_named(json_mcap):
    path = json_mcap(stamp=("sec", "nanosec"), use_chunking=False)
    content = path.read_bytes()
    place = content.rindex(b'"sec"')
    path.write_bytes(content[:place] + b'"sxc"' + content[place + 5 :])
    with pytest.raises(InputError, match=r"message 200 of /samples: expected tip.position_mm, f"):
        read_signals(path)


def test_messages_that_nothing_decodes_are_named(json_mcap, refused):
    path = json_mcap("protobuf")
    assert "no numbers in messages of ROS 2 or JSON: found /samples (protobuf)" in refused(
        "estimate", path
    )


def test_a_message_unlike_the_first_is_named(tmp_path, json_mcap):
    path = json_mcap(use_chunking=False)
    content = path.read_bytes()
    place = content.rindex(b"position_mm")
    path.write_bytes(content[:place] + b"position_xx" + content[place + 11 :])
    with pytest.raises(InputError, match=r"message 200 of /samples: expected tip.position_mm, f"):
        read_signals(path)


@pytest.mark.parametrize("cut", [20, 1000, 5000, -20])
def test_a_foreign_file_that_was_cut_off_is_refused_in_one_line(json_mcap, refused, cut):
    path = json_mcap()
    path.write_bytes(path.read_bytes()[:cut])
    assert "json.mcap" in refused("estimate", path)


def test_a_missing_library_is_named(ros2_mcap, refused, without):
    without("mcap_ros2")
    message = refused("estimate", ros2_mcap)
    assert "needs mcap-ros2-support: expected pip install 'telepalpation[formats]'" in message


def test_a_topic_is_for_files_of_messages(tmp_path, refused):
    path = tmp_path / "data.csv"
    path.write_text("Time [s],Position [m],Force [N]\n0,0,0\n1,1,1\n2,2,2\n")
    message = refused("estimate", path, "--topic", "/a")
    assert "data.csv: --topic is for a ROS bag or an MCAP file" in message
