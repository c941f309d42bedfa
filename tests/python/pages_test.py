"""Stages that make studios, pages and pictures: what they leave is what the program leaves."""
import json

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import numpy as np
import pytest
from mvstudio import stages

SHAPE = dict(cameras=4, size="160x120", board_frames=0, take_frames=6, samples=1, texture_px=64, format="png")


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    report = stages.synth(out=folder / "studio", **SHAPE)
    assert report.ok
    return folder


def test_synth_is_the_programs(studio):
    mvstudio.command("synth", out=studio / "program", **SHAPE)
    names = ["mvstudio.toml", "truth/calibration.json", "raw/take1/cam_02/00000003.png", "truth/pose3d/body3DScene_00000002.json"]
    there = [name for name in names if (studio / "program" / name).exists()]
    assert len(there) >= 2
    for name in there:
        assert (studio / "studio" / name).read_bytes() == (studio / "program" / name).read_bytes(), name
    with pytest.raises(mvstudio.Error, match="`overwrite`"):
        stages.synth(out=studio / "program", **SHAPE)
    assert stages.synth(out=studio / "program", overwrite=True, **SHAPE).ok


@pytest.fixture(scope="module")
def data(studio):
    truth = studio / "studio/truth"
    stages.dataset_build(session=studio / "studio", take="take1", calib=truth / "calibration.json", pose3d=truth / "pose3d",
                         masks=truth / "masks/take1", png=True, out=studio / "data")
    return studio / "data"


def test_datasets_are_replaced_where_that_is_asked_for(studio, data):
    truth = studio / "studio/truth"
    again = [lambda **given: stages.dataset_build(session=studio / "studio", take="take1", calib=truth / "calibration.json", png=True,
                                                  pose3d=truth / "pose3d", masks=truth / "masks/take1", out=studio / "data2", **given),
             lambda **given: stages.dataset_import_panoptic(data, studio / "imported", **given),
             lambda **given: stages.dataset_export(data, "colmap", studio / "colmap", **given)]
    for stage in again:
        assert stage().ok
        with pytest.raises(mvstudio.Error, match="exists already"):
            stage()
        assert stage(overwrite=True).ok


def test_verify_says_what_the_program_says(data):
    ours, theirs = stages.dataset_verify(data), mvstudio.command("dataset verify", data)
    assert ours.exit == theirs.exit == 0 and ours.metrics == theirs.metrics
    assert stages.dataset_info(data).metrics == mvstudio.command("dataset info", data).metrics
    image = next((data / "hdImgs").rglob("*.png"))
    kept = image.read_bytes()
    image.write_bytes(kept[:200])
    try:
        found = []
        for verify in (stages.dataset_verify, lambda folder: mvstudio.command("dataset verify", folder)):
            with pytest.raises(mvstudio.Error, match="the PNG file ends early") as caught:
                verify(data)
            found.append((caught.value.code, caught.value.report.exit, caught.value.report.metrics))
        assert found[0] == found[1] and found[0][1] == 6
    finally:
        image.write_bytes(kept)


def test_a_share_of_a_check_can_be_done_again(studio, data):
    share = dict(cache=studio / "checks", part="share=0/2", keep=studio / "share")
    assert [stages.dataset_verify(data, **share).metrics.kept for _ in range(2)] == [2, 2]
    assert stages.dataset_verify(data, cache=studio / "checks").metrics == stages.dataset_verify(data).metrics


def test_overlay_draws_over_the_footage(studio):
    truth = studio / "studio/truth"
    report = stages.render_overlay(studio / "studio", studio / "overlay", sheet=3)
    assert report.ok and any(path.suffix == ".mp4" for path in (studio / "overlay").iterdir()), list((studio / "overlay").iterdir())
    assert truth.is_dir()


def test_error_budget_is_the_programs(studio):
    given = dict(session=studio / "studio", calib=studio / "studio/truth/calibration.json")
    ours = stages.error_budget(**given, out=studio / "budget")
    theirs = mvstudio.command("error-budget", **given, out=studio / "budget_program")
    assert ours.exit == theirs.exit and ours.metrics.keys() == theirs.metrics.keys()
    assert ours.metrics.joints_mm == theirs.metrics.joints_mm and ours.metrics.next == theirs.metrics.next


def test_report_shows_what_python_made(studio):
    rig = mvstudio.Rig(studio / "studio/truth/calibration.json")
    run = studio / "run"
    run.mkdir()
    with open(studio / "wand.csv", "w", encoding="utf-8") as file:
        file.write("camera,frame,person,joint,x_px,y_px,score\n")
        for frame in range(20):
            for name in rig.names:
                for joint, x in (("grip", [0.1 * np.sin(frame), 0, 1.0]), ("top", [0.1 * np.sin(frame), 0.3, 1.0])):
                    px = rig.project(x, name)
                    file.write(f"{name},{frame},0,{joint},{px[0]!r},{px[1]!r},1\n")
    stages.triangulate(calib=studio / "studio/truth/calibration.json", points2d=studio / "wand.csv", out=run / "pose3d")
    report = stages.report(run)
    assert (run / "report.html").exists() and report.ok
    page = json.loads((run / "report.json").read_text(encoding="utf-8"))
    assert "triangulate" in json.dumps(page)
    stages.report(run, title="Once more")  # a report is always written anew
    assert "Once more" in (run / "report.html").read_text(encoding="utf-8")
    with pytest.raises(mvstudio.Error, match="only the program leaves paths out"):
        stages.report(run, for_="client")
    with pytest.raises(mvstudio.Error, match="report needs one of `runs`"):
        stages.report()
