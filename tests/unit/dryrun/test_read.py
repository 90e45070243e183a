"""Files that a dry run reads, and what it refuses: one line, naming the place."""

import json

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.read import read_program
from weldsim.dryrun.try_script import try_script
from weldsim.errors import InputError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.mounts import X_FT
from weldsim.scene.world import HOME as HOME_ARM

POSE = "0.0,-0.45,0.1,3.1,0.0,0.0"


def _document(**changes):
    poses = [{"s": 0.01 * i, "position": [0.01 * i, -0.45, 0.05], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]} for i in range(3)]
    points = [pose["position"] for pose in poses]
    seam = {"id": "seam-1", "points": points, "poses": poses, "speed": 0.008, **changes}
    return {"schema": "weldsim.path/1", "frame": "base", "units": {"length": "m", "angle": "rad"}, "seams": [seam]}


def _poses(**changes):
    return [
        {"s": 0.01 * i, "position": [0.01 * i, -0.45, 0.05], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0], **changes} for i in range(3)
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("tool", ["torch", "tool0"])
@pytest.mark.parametrize("base", ["controller", "base_link"])
def test_a_csv_in_either_frame_gives_the_torch_in_the_controllers_base(tmp_path, seed, tool, base):
    rng = np.random.default_rng(seed)
    p = np.array([0, -0.5, 0.2]) + 0.1 * rng.normal(size=(8, 3))
    truth = Transform("BT", matrix_from_rotation_vector(rng.uniform(-1.5, 1.5, (8, 3))), p)
    said = truth if tool == "torch" else truth @ X_FT.inverse()
    R, at = said.R, said.p
    if base == "base_link":
        turn = np.diag([-1.0, -1.0, 1.0])
        R, at = turn @ R, at @ turn
    rows = np.column_stack([at, Transform("BT", R, at).rotation_vector])
    file = tmp_path / "poses.csv"
    file.write_text("\n".join(",".join(f"{v:.12f}" for v in row) for row in rows))
    program = read_program(file, tool=tool, base=base)
    assert np.abs(program.paths[0].X_BT.p - truth.p).max() < 1e-9
    assert np.abs(program.paths[0].X_BT.R - truth.R).max() < 1e-8
    assert not program.paths[0].roll_free


def test_a_csv_that_says_base_link_is_read_so_and_the_option_overrules_it(tmp_path):
    rows = "\n".join(f"{0.01 * i:.3f},0.45,0.05,3.1,0.0,0.0" for i in range(5))
    (tmp_path / "a.csv").write_text("# torch tip, frame: base_link\nx,y,z,rx,ry,rz\n" + rows)
    (tmp_path / "b.csv").write_text("# torch tip\nx,y,z,rx,ry,rz\n" + rows)
    told, bare = read_program(tmp_path / "a.csv"), read_program(tmp_path / "b.csv")
    assert any("says base_link" in note for note in told.notes)
    np.testing.assert_allclose(told.paths[0].X_BT.p, read_program(tmp_path / "b.csv", base="base_link").paths[0].X_BT.p)
    np.testing.assert_allclose(bare.paths[0].X_BT.p, read_program(tmp_path / "a.csv", base="controller").paths[0].X_BT.p)
    assert np.abs(told.paths[0].X_BT.p - bare.paths[0].X_BT.p).max() > 0.8


@pytest.mark.parametrize("names", ["speed,arc", "velocity [mm/s],arc_on", "v,weld", "feed rate,blend radius"])
def test_columns_that_say_how_to_move_or_weld_are_named_as_not_read(tmp_path, names):
    rows = "\n".join(f"{0.01 * i:.3f},-0.45,0.05,3.1,0.0,0.0,0.02,1" for i in range(5))
    (tmp_path / "a.csv").write_text(f"# torch\nx,y,z,rx,ry,rz,{names}\n{rows}")
    (note,) = read_program(tmp_path / "a.csv").notes
    assert note.startswith(f"what these columns say is not read: {names.replace(',', ', ')}; ")
    (tmp_path / "b.csv").write_text(f"# torch\nx,y,z,rx,ry,rz,time,index\n{rows}")
    assert not read_program(tmp_path / "b.csv").notes


@pytest.mark.parametrize("head", ["# units: mm\n", "# units: mm\nx,y,z,rx,ry,rz\n", "x [mm],y [mm],z [mm],rx,ry,rz\n"])
def test_millimetres_said_in_a_comment_or_as_the_refusal_advises(tmp_path, head):
    rows = "\n".join(f"{10 * i},-450,50,3.1,0.0,0.0" for i in range(5))
    (tmp_path / "a.csv").write_text(rows)
    with pytest.raises(InputError, match=r"looks like millimetres; .*or name the columns x \[mm\], y \[mm\], z \[mm\]"):
        read_program(tmp_path / "a.csv", tool="torch")
    (tmp_path / "a.csv").write_text(head + rows)
    np.testing.assert_allclose(read_program(tmp_path / "a.csv", tool="torch").paths[0].X_BT.p[-1], [0.04, -0.45, 0.05])


def test_joints_in_degrees_are_read_once_written_as_the_refusal_advises(tmp_path):
    file = tmp_path / "p.script"
    file.write_text("movej([0, -90, 90, -90, -90, 0])\nmovej([10, -90, 90, -90, -90, 0])\n")
    with pytest.raises(InputError, match=r"looks like degrees; write d2r\(\.\.\.\) around each"):
        read_program(file)
    around = ", ".join(f"d2r({angle})" for angle in (0, -90, 90, -90, -90, 0))
    file.write_text(f"movej([{around}])\nmovej([d2r(10){around[6:]}])\n")
    assert read_program(file).kind == "script"


def test_a_csv_that_weldsim_wrote_says_its_frame(tmp_path):
    from weldsim.path.files import write_path_csv

    document = _document()
    for tool in ("torch", "tool0"):
        write_path_csv(tmp_path / "w.csv", document, tool=tool)
        program = read_program(tmp_path / "w.csv")
        assert np.abs(program.paths[0].X_BT.p - [pose["position"] for pose in document["seams"][0]["poses"]]).max() < 1e-6
        assert program.notes == ()


def test_the_thesis_program_is_tool0_in_the_controllers_base(real_data):
    program = read_program(real_data / "thesis_paths/ur_y_shape.csv")
    tips = np.loadtxt(real_data / "thesis_paths/tip_y_shape.csv", delimiter=",")
    assert np.abs(program.paths[0].X_BT.p * [-1, -1, 1] - tips[:, :3]).max() < 1e-5
    assert "tool0" in program.notes[0]


def test_a_script_is_read_line_by_line(tmp_path):
    file = tmp_path / "job.script"
    file.write_text(
        "def job():\n  set_tcp(p[0, 0.048, 0.227, d2r(-48.7), 0, 0])  # torch\n  home = [-1.57, -1.3, -1.9,\n    -1.5, 1.57, 0]\n"
        "  v1 = 0.02\n  movej(home, a=1.4, v=1.05)\n  movel(p[0.0, -0.45, 0.1, 3.1, 0, 0], v=v1/2)\n  set_digital_out(0, True)\n"
        '  movep(p[0.05, -0.45, 0.1, 3.1, 0, 0], 1.2, 0.008)\n  set_digital_out(0, False)\n  textmsg("done, # no")\n  sleep(0.5)\n'
        "  servoj([-1.57, -1.3, -1.9, -1.5, 1.57, 0], t=0.008, lookahead_time=0.1, gain=300)\nend\njob()\n"
    )
    program = read_program(file)
    assert [m.command for m in program.motions] == ["movej", "movel", "movep", "servoj"]
    assert [m.line for m in program.motions] == [6, 7, 9, 13]
    assert [m.arc for m in program.motions] == [False, False, True, False]
    assert program.motions[1].speed == pytest.approx(0.01)
    assert program.motions[2].speed == pytest.approx(0.008)
    assert program.motions[1].X_BT is not None
    assert np.allclose(program.motions[1].X_BT.p, [0, -0.45, 0.1], atol=1e-4)
    assert program.pauses == 0.5


HOME = "[-1.57, -1.3, -1.9, -1.5, 1.57, 0]"


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_a_script_is_read_in_the_order_in_which_it_moves(tmp_path, newline):
    """Functions called twice or never, targets that are computed, loops that end, lines of any system, a byte order mark."""
    file = tmp_path / "job.script"
    text = (
        "def down(depth, speed=0.05):\n  movel(pose_trans(get_target_tcp_pose(), p[0, 0, depth, 0, 0, 0]), v=speed)\nend\n"
        "def never():\n  movel(p[2, 2, 2, 0, 0, 0])\nend\n"
        f"home = {HOME};  # (open\n"
        'textmsg("a (bracket # here")\n'
        "movej(home)\ndown(0.01)\n"
        "i = 0\nwhile i < 2:\n  down(0.02, speed=i / 10 + 0.01)\n  i = i + 1\nend\nset_digital_out(3, i == 2)\n"
        "home[5] = d2r(10)\nmovej(home)\nset_digital_out(4, False)\n"
        "movej(get_inverse_kin(get_forward_kin(home)))\nhalt\nmovej(home)\n"
    )
    file.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", newline).encode())
    program = read_program(file)
    assert [m.command for m in program.motions] == ["movej", "movel", "movel", "movel", "movej", "movej"]
    assert [m.line for m in program.motions] == [9, 2, 2, 2, 18, 20]
    assert [m.speed for m in program.motions] == pytest.approx([1.05, 0.05, 0.01, 0.11, 1.05, 1.05])
    assert [m.arc for m in program.motions] == [False, False, False, False, True, True]
    tips = [m.X_BT.p for m in program.motions if m.X_BT is not None]
    assert np.linalg.norm(np.diff(tips, axis=0), axis=1) == pytest.approx([0.02, 0.02], abs=1e-9)
    first, last = program.motions[-2:]
    assert first.q is not None
    assert last.q is not None
    assert last.q == pytest.approx(first.q, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("p.json", "{", "is no JSON"),
        ("p.json", json.dumps({"schema": "other"}), "schema"),
        ("p.json", json.dumps({**_document(), "seams": []}), "nothing to check"),
        ("p.json", json.dumps(_document(poses=_poses()[:1])), "1 pose; a path needs two"),
        ("p.json", json.dumps(_document(poses=_poses(quaternion_wxyz=[0, 1.1, 0, 0]))), "quaternion length"),
        ("p.json", json.dumps(_document(poses=_poses(position=[float("nan"), 0, 0]))), "not finite"),
        (
            "p.json",
            json.dumps(_document(poses=[{**p, "position": [1e3 * v for v in p["position"]]} for p in _poses()])),
            "millimetres",
        ),
        ("p.csv", "", "0 poses"),
        ("p.csv", POSE, "1 pose; a path needs two"),
        ("p.csv", f"{POSE}\n{POSE},1\n", "line 2: 7 columns"),
        ("p.csv", f"{POSE}\nnan,0,0,0,0,0\n", "line 2"),
        ("p.csv", f"{POSE}\n12.0,-450.0,100.0,3.1,0,0\n", "millimetres"),
        ("p.csv", f"{POSE}\n0,-0.45,0.1,180.0,0,0\n", "degrees"),
        ("p.csv", f"x [mm],y,z,rx,ry,rz\n{POSE}\n{POSE}\n", "y, z are not all in one unit"),
        ("p.csv", f"{POSE}\n{POSE}\n".replace(".", ","), "line 1: .* columns"),
        ("p.csv", f"{POSE}\n{POSE}\n", "all 2 poses are in one place"),
        ("p.json", json.dumps(_document(poses=[{**p, "s": 1e3 * p["s"]} for p in _poses()])), "arc length in metres"),
        ("p.json", json.dumps(_document(poses=[{**p, "position": [0, -0.4, 0.1]} for p in _poses()])), "in one place"),
        ("p.csv", f"x,y,z,a,b,c\n{POSE}\n{POSE}\n", "column rx"),
        ("p.script", "def a():\nend\n", "nothing to check"),
        ("p.script", f"movel(p[{POSE}])", "1 motion"),
        ("p.script", f"while True:\n movel(p[{POSE}])\nend", "line 1: while"),
        ("p.script", "movel(p[0,0,0)", "line 1: expected ',' between values"),
        ("p.script", "movej([1,2,3])", "six joint angles"),
        ("p.script", "movej([nan,0,0,0,0,0])", "line 1: variable 'nan' is not defined"),
        ("p.script", "movel(p[0, -450, 100, 0, 0, 0])", "millimetres"),
        ("p.script", "movej([90, -90, 0, 0, 0, 0])", "degrees"),
        ("p.script", "movec(p[0,0,0,0,0,0], p[0,0,0,0,0,0])", "movec"),
        ("p.script", "movej(get_target())", "line 1: there is no function 'get_target'"),
        ("p.script", "movej([0,0,0,0,0,0], v=-1)", "positive"),
        ("p.script", f"set_tcp(p[0, 48, 227, 0, 0, 0])\nmovel(p[{POSE}])", "line 1: set_tcp.*millimetres"),
        ("p.script", f"set_tcp(p[0, 0, 0.2, -48.7, 0, 0])\nmovel(p[{POSE}])", "line 1: set_tcp.*degrees"),
        ("p.script", f"sleep(-1)\nmovel(p[{POSE}])", "line 1: sleep"),
        ("p.script", "drive around", "line 1: variable 'drive' is not defined"),
        ("p.script", f"movl(p[{POSE}])\nmovel(p[{POSE}])", "line 1: there is no function 'movl'"),
        ("p.script", f"movel(p[{POSE}], speed=0.1)", "line 1: movel.*'speed'"),
        ("p.script", f"movel(p[{POSE}], r=-0.1)", "line 1: movel: .*blend radius"),
        ("p.script", f"if get_digital_in(0):\n movel(p[{POSE}])\nend", "line 1: get_digital_in: .*cannot be told"),
        ("p.script", f"thread t():\n movel(p[{POSE}])\nend\nx = run t()\nmovel(p[{POSE}])", "line 4: run: .*cannot be told"),
        ("p.script", "a = get_actual_tcp_pose()\nmovel(a)", "line 1: get_actual_tcp_pose: .*not known"),
        ("p.script", "movej([1e999,0,0,0,0,0])", "line 1: 1e999 is too large"),
        ("p.docx", "", "is needed"),
    ],
)
def test_bad_input_is_one_line(tmp_path, name, text, says):
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        read_program(file)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_missing_file_is_one_line(tmp_path):
    for name in ("a.json", "a.csv", "a.script"):
        with pytest.raises(InputError, match="cannot be read"):
            read_program(tmp_path / name)


def test_paths_of_tests_have_the_form_that_is_read():
    assert torch_path(flat_curve("line", 0.1), np.array([0, 0, -1.0])).roll_free


@pytest.mark.parametrize(
    "spelt",
    [
        lambda text: text.replace(",", ";"),
        lambda text: text.replace(",", ";").replace(".", ","),
        lambda text: text.replace(",", "\t"),
        lambda text: text.replace(",", " "),
        lambda text: "X [m], Y [m], Z [m], RX [rad], RY [rad], RZ [rad]\r\n" + text.replace("\n", "\r\n"),
        lambda text: "\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in text.splitlines()),
        lambda text: text.replace("\n", "  # weld\n\n"),
    ],
)
def test_a_csv_may_be_written_in_other_ways(tmp_path, spelt):
    text = "0.1,-0.45,0.1,3.1,0,0.01\n0.12,-0.45,0.1,3.1,0,0.01\n0.14,-0.45,0.1,3.1,0,0.02\n"
    plain, other = tmp_path / "plain.csv", tmp_path / "other.csv"
    plain.write_text(text)
    other.write_text(spelt(text))
    one, two = read_program(plain).paths[0], read_program(other).paths[0]
    assert np.array_equal(one.X_BT.p, two.X_BT.p)
    assert np.array_equal(one.X_BT.R, two.X_BT.R)


def test_rows_that_end_with_a_separator_or_are_poses_are_read(tmp_path) -> None:
    rows = ["0.0, -0.45, 0.1, 0, 3.14, 0", "0.1, -0.45, 0.1, 0, 3.14, 0"]
    want = np.array([[0.0, -0.45, 0.1], [0.1, -0.45, 0.1]])
    for k, pattern in enumerate(("{},", "p[{}]", "[{}]")):
        file = tmp_path / f"{k}.csv"
        file.write_text("\n".join(pattern.format(row) for row in rows))
        assert np.allclose(read_program(file, tool="torch").paths[0].X_BT.p, want)


def test_a_program_that_repeats_itself_for_ever_is_read_for_two_rounds(tmp_path) -> None:
    """PolyScope's own main loop: it never ends."""
    file = tmp_path / "loop.script"
    file.write_text(
        "def prog():\n  movej([-1.57, -1.3, -1.9, -1.5, 1.57, 0])\n  while (True):\n    movel(p[0.05, -0.45, 0.2, 0, 3.14, 0])\n"
        "    movel(p[-0.05, -0.45, 0.2, 0, 3.14, 0])\n  end\nend\n"
    )
    program = read_program(file)
    assert [motion.line for motion in program.motions] == [2, 4, 5, 4, 5]
    assert any("two rounds" in note for note in program.notes)
    # A loop without a motion, and one whose motions differ from round to round, are no such thing.
    file.write_text("movej([0, 0, 0, 0, 0, 0])\nmovej([0, 0, 0, 0, 0, 1])\nwhile True:\n  sync()\nend\n")
    with pytest.raises(InputError, match="does not end by itself"):
        read_program(file)
    file.write_text("i = 0\nwhile i < 1200:\n  movej([0, 0, 0, 0, 0, i / 1000])\n  i = i + 1\nend\n")
    assert len(read_program(file).motions) == 1200


ROWS = np.array([[0.1, -0.45, 0.1, 3.1, 0.0, 0.01], [0.12, -0.45, 0.1, 3.1, 0.0, 0.01], [0.14, -0.452, 0.1, 3.1, 0.01, 0.02]])


def _table(head: str, order: list[int], mark: str = ",", comma: bool = False, extra: tuple[str, ...] = ()) -> str:
    rows = [mark.join([*extra, *(f"{row[k]:g}" for k in order)]) for row in ROWS]
    return "\n".join([head, *(row.replace(".", ",") if comma else row for row in rows)])


@pytest.mark.parametrize(
    "text",
    [
        _table("x,y,z,rx,ry,rz", [0, 1, 2, 3, 4, 5]),
        _table("rx;ry;rz;x;y;z", [3, 4, 5, 0, 1, 2], ";", comma=True),
        _table("Z [m]\tY [m]\tX [m]\tRZ [rad]\tRY [rad]\tRX [rad]", [2, 1, 0, 5, 4, 3], "\t", comma=True),
        _table("pos_x pos_y pos_z rot_x rot_y rot_z", [0, 1, 2, 3, 4, 5], " "),
        _table("t;TCP_X (m);TCP_Y (m);TCP_Z (m);TCP_Rx (rad);TCP_Ry (rad);TCP_Rz (rad)", [0, 1, 2, 3, 4, 5], ";", extra=("0.008",)),
        _table("timestamp " + " ".join(f"actual_TCP_pose_{k}" for k in range(6)), [0, 1, 2, 3, 4, 5], " ", extra=("17.25",)),
        _table("seam,s,x,y,z,rx,ry,rz", [0, 1, 2, 3, 4, 5], extra=("weld", "0")),
        _table("% Schweißnaht; 5 µm", [0, 1, 2, 3, 4, 5], ";", comma=True),
        _table("# x y z rx ry rz", [0, 1, 2, 3, 4, 5], "  ", comma=True) + "\n\n",
        "Export vom Montag\n" + _table("x;y;z;rx;ry;rz", [0, 1, 2, 3, 4, 5], ";", comma=True),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_names_orders_decimal_commas_and_encodings_of_a_table(tmp_path, text, encoding, newline) -> None:
    file = tmp_path / "poses.csv"
    file.write_bytes(text.replace("\n", newline).encode(encoding))
    X_BT = read_program(file, tool="torch").paths[0].X_BT
    assert np.abs(np.column_stack([X_BT.p, X_BT.rotation_vector]) - ROWS).max() < 1e-9


ANGLES = np.rad2deg([[-1.57, -1.3, -1.9, -1.5, 1.57, 0.0], [-1.5, -1.3, -1.9, -1.5, 1.57, 0.1]])


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (ANGLES, "line [12]: .*looks like six joint angles in degrees, or millimetres and degrees"),
        (ROWS * [1e3, 1e3, 1e3, 1, 1, 1], "looks like millimetres; x y z"),
        (ROWS * [1, 1, 1, 57.3, 57.3, 57.3], "looks like degrees; x y z"),
        (ROWS * [1e4, 1e4, 1e4, 57.3, 57.3, 57.3], "looks like millimetres and degrees; x y z"),
    ],
)
def test_numbers_of_another_unit_are_called_what_they_are(tmp_path, rows, says) -> None:
    file = tmp_path / "poses.csv"
    np.savetxt(file, rows, delimiter=",")
    with pytest.raises(InputError, match=says) as caught:
        read_program(file)
    assert "\n" not in str(caught.value)


def test_joint_angles_go_into_a_script_as_the_message_says(tmp_path) -> None:
    file = tmp_path / "poses.csv"
    np.savetxt(file, ANGLES, delimiter=",")
    with pytest.raises(InputError, match=r"joint angles: movej\(\[d2r\(\.\.\.\), \.\.\.\]\) in a \.script"):
        read_program(file)
    script = tmp_path / "angles.script"
    script.write_text("\n".join(f"movej([{', '.join(f'd2r({value})' for value in row)}])" for row in ANGLES))
    assert np.allclose([motion.q for motion in read_program(script).motions], np.deg2rad(ANGLES))
    body = file.read_text()
    for head in (
        "base,shoulder,elbow,wrist1,wrist2,wrist3",
        "J1 [deg],J2 [deg],J3 [deg],J4 [deg],J5 [deg],J6 [deg]",
        "q0,q1,q2,q3,q4,q5",
    ):
        file.write_text(f"{head}\n{body}")
        with pytest.raises(InputError, match=r"these are joint angles: movej in a \.script"):
            read_program(file)
    np.savetxt(file, np.deg2rad(ANGLES), delimiter=",")
    assert any("if these are six joint angles" in note for note in read_program(file).notes)


@pytest.mark.parametrize("tool", ["torch", "tool0"])
@pytest.mark.parametrize("name", ["bare.script", "bare.csv"])
def test_the_option_that_a_note_recommends_is_taken_and_the_note_is_gone(tmp_path, name, tool) -> None:
    file = tmp_path / name
    poses = ["0.0,-0.45,0.3,3.1,0.0,0.0", "0.05,-0.45,0.3,3.1,0.0,0.0"]
    file.write_text("\n".join(f"movel(p[{pose}])" if name.endswith("script") else pose for pose in poses))
    plain = read_program(file)
    assert any(f"--tool {'tool0' if name.endswith('script') else 'torch'}" in note for note in plain.notes)
    chosen = read_program(file, tool=tool)
    assert not any("--tool" in note for note in chosen.notes)
    X_BT = chosen.motions[0].X_BT if chosen.motions else chosen.paths[0].X_BT[0]
    assert X_BT is not None
    said = X_BT.p if tool == "torch" else (X_BT @ X_FT.inverse()).p
    assert said == pytest.approx([0.0, -0.45, 0.3], abs=1e-9)
    if chosen.motions:
        assert len(try_script(chosen, empty_cell(np.array(HOME_ARM))).verdicts) == len(poses)


@pytest.mark.parametrize(
    ("name", "said", "says"),
    [
        ("p.json", {"tool": "tool0"}, "--tool is for CSV and scripts"),
        ("p.json", {"base": "base_link"}, "--base is for CSV"),
        ("p.script", {"base": "base_link"}, "--base is for CSV"),
        ("p.script", {"roll_free": True}, "--roll is for paths"),
    ],
)
def test_an_option_that_a_file_has_no_use_for_is_refused(tmp_path, name, said, says) -> None:
    file = tmp_path / name
    file.write_text(json.dumps(_document()) if name.endswith("json") else f"movel(p[{POSE}])\nmovel(p[{POSE}])")
    read_program(file)
    with pytest.raises(InputError, match=says):
        read_program(file, **said)


@pytest.mark.parametrize(
    "before", ["sec lamp():\n  set_digital_out(1, True)\nend\n", "def weld(pose, speed=0.01):\n  movel(pose, v=speed)\nend\n"]
)
def test_a_script_that_never_calls_what_it_defines_says_so_and_the_call_helps(tmp_path, before):
    file = tmp_path / "two.script"
    text = f"{before}def go():\n  movel(p[{POSE}])\n  movel(p[0.05,{POSE[4:]}])\nend\n"
    file.write_text(text)
    with pytest.raises(InputError, match=r"never calls what it defines \(.*go\).* go\(\) say$"):
        read_program(file)
    file.write_text(text + "go()\n")
    assert len(read_program(file).motions) == 2


def test_polyscopes_own_file_is_named_for_what_it_is(tmp_path):
    (tmp_path / "weld.urp").write_bytes(b"\x1f\x8b\x08")
    with pytest.raises(InputError, match=r"is PolyScope's own; the \.script"):
        read_program(tmp_path / "weld.urp")


def test_a_run_directory_is_answered_with_the_path_in_it(tmp_path):
    with pytest.raises(InputError, match=r"is a folder; \.json"):
        read_program(tmp_path)
    (tmp_path / "path.json").write_text(json.dumps(_document()))
    with pytest.raises(InputError, match="did you mean") as caught:
        read_program(tmp_path)
    meant = str(caught.value).partition("did you mean ")[2].removesuffix("?")
    assert read_program(meant).names == ("seam-1",)
    (tmp_path / "cloud.ply").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"cloud\.ply: \.json .* is needed"):
        read_program(tmp_path / "cloud.ply")
