#!/usr/bin/env python3
"""Checks the generator and the judge without the program: a true result with true sigmas is right, a shifted one silent and wrong."""

import copy
import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
try:
    import numpy as np
except ImportError:
    print("needs python3-numpy")
    sys.exit(77)

import alarms  # noqa: E402
import judge  # noqa: E402
import registry  # noqa: E402
import rigid  # noqa: E402
import run as runner  # noqa: E402
import studio  # noqa: E402
import tables  # noqa: E402
import truth  # noqa: E402
from kinds_cameras import turned  # noqa: E402
from lens import Lens, axis_of, axis_sigmas, param_names, project, rays  # noqa: E402
from program import Run  # noqa: E402
from recording import Recording, altered, make, make_scene, observe  # noqa: E402

LENSES = [Lens("pinhole", np.array([800, 805, 319, 241.0])),
          Lens("brown5", np.array([800, 805, 319, 241, -0.2, 0.05, 1e-3, -5e-4, 0.01])),
          Lens("rational8", np.array([800, 805, 319, 241, 0.3, 0.02, 1e-3, -5e-4, 0.01, 0.5, 0.02, 0.0])),
          Lens("kannala4", np.array([300, 301, 319, 241, -0.01, 1e-3, 0, 0])),
          Lens("ucm_p", np.array([600, 601, 319, 241, 0.8, 1e-4, -1e-4])),
          Lens("eucm", np.array([320, 321, 319, 241, 0.6, 1.1])),
          Lens("doublesphere", np.array([300, 301, 319, 241, -0.2, 0.6]))]
FOCAL_SIGMA = 0.5


class LensTest(unittest.TestCase):
    def test_rays_lead_back_to_their_pixels(self):
        px = np.array([[319, 241], [30.0, 40], [600, 200], [319, 470]])
        for lens in LENSES:
            back = project(lens, 3 * rays(lens, px))
            np.testing.assert_allclose(back, px, atol=1e-4, err_msg=lens.model)

    def test_focal_length_on_the_axis(self):
        np.testing.assert_allclose(axis_of(LENSES[1])[0], [800, 805], rtol=1e-6)
        np.testing.assert_allclose(axis_of(LENSES[4])[0], np.array([600, 601]) / 1.8, rtol=1e-6)
        np.testing.assert_allclose(axis_of(LENSES[3])[1], [319, 241], atol=1e-3)

    def test_sigma_of_the_focal_length_follows_the_parameters(self):
        covariance = np.diag([4.0, 4.0, 1, 1, 0.01 ** 2, 0, 0])
        expected = np.hypot(2 / 1.8, 600 / 1.8 ** 2 * 0.01)
        self.assertAlmostEqual(axis_sigmas(LENSES[4], covariance)[0], expected, delta=1e-3)

    def test_brown_lens_by_hand(self):
        lens = Lens("brown4", np.array([100, 100, 0, 0, 0.1, 0, 0.01, 0.02]))
        a, b, s = 0.5, 0.25, 0.3125
        x = a * (1 + 0.1 * s) + 2 * 0.01 * a * b + 0.02 * (s + 2 * a * a)
        y = b * (1 + 0.1 * s) + 0.01 * (s + 2 * b * b) + 2 * 0.02 * a * b
        np.testing.assert_allclose(project(lens, np.array([1.0, 0.5, 2.0])), [100 * x, 100 * y], rtol=1e-12)

    def test_spline_without_control_points_is_stereographic(self):
        grid = {"order": 3, "cols": 8, "rows": 6, "fov_x_deg": 120}
        lens = Lens("splined", np.array([500, 500, 300, 200] + [0.0] * 96), grid)
        shifted = Lens("splined", np.array([500, 500, 300, 200] + [0.01, -0.02] * 48), grid)
        x = np.array([0.3, -0.2, 1.0])
        plane = 2 * x[:2] / (np.linalg.norm(x) + 1)
        np.testing.assert_allclose(project(lens, x), 500 * plane + [300, 200], rtol=1e-12)
        np.testing.assert_allclose(project(shifted, x), 500 * (plane + [0.01, -0.02]) + [300, 200], rtol=1e-12)

    def test_behind_the_camera_is_no_picture(self):
        self.assertTrue(np.isnan(project(LENSES[1], np.array([0.1, 0.1, -1.0]))).all())


class RigidTest(unittest.TestCase):
    def test_exp_and_log(self):
        rng = np.random.default_rng(1)
        for w in rng.uniform(-1.7, 1.7, (20, 3)):
            np.testing.assert_allclose(rigid.log(rigid.exp(w)), w, atol=1e-9)
            np.testing.assert_allclose(rigid.from_quaternion(rigid.quaternion(rigid.exp(w))), rigid.exp(w), atol=1e-12)


# ---- a program that is right by construction ------------------------------------------------------------------------------------

def exact(rng=None):
    """A recording without noise."""
    scene = make_scene(rng or np.random.default_rng(5), count=4, frames=20, sigma=1e-9)
    return Recording(scene, observe(np.random.default_rng(6), scene))


def answer(recording, cameras=None, messages=(), exit_code=0, verdict="pass", sigma_px=0.05, shifted_px=0.0, scale=1.0):
    """What a program would write that found `cameras` (default: the truth), first camera first, focal lengths off by shifted_px."""
    cameras = cameras or recording.truths[0]
    entries, reports, ranges = [], [], []
    first = cameras[0].cam_from_world[0], cameras[0].cam_from_world[1] * scale
    for camera in cameras:
        own = camera.cam_from_world[0], camera.cam_from_world[1] * scale
        rotation, translation = rigid.compose(own, rigid.inverse(first))
        params = camera.lens.params.copy()
        params[:2] += shifted_px
        variances = np.full(len(params), 1e-6)
        variances[:2] = FOCAL_SIGMA ** 2
        pose = np.zeros((6, 6)) if camera is cameras[0] else np.diag([1e-4 ** 2] * 3 + [1e-3 ** 2] * 3)
        entries.append({"name": camera.name, "size_px": list(camera.size), "model": camera.lens.model,
                        "intrinsics": dict(zip(param_names(camera.lens.model), params)),
                        "intrinsics_covariance": np.diag(variances).tolist(), "cam_from_world_covariance": pose.tolist(),
                        "cam_from_world": {"rotation_xyzw": rigid.quaternion(rotation).tolist(), "translation": translation.tolist()}})
        reports.append({"name": camera.name, "model": camera.lens.model, "sigma_px": 0.2, "coverage_cells": [[1] * 10] * 8,
                        "uncertainty_map_px": [[sigma_px] * 12] * 8})
        ranges.append({"name": camera.name, "range_m": 2.0})
    metrics = {"cameras": reports, "uncertainty": {"cameras": ranges}, "gauge": f"camera {cameras[0].name}", "verdict": {"status": verdict}}
    warnings = [{"code": code, "text": text, "hint": hint} for code, text, hint in messages]
    return Run(exit_code, {"metrics": metrics, "warnings": warnings, "errors": []}, {"cameras": entries}, "", 1.0)


def refused(code, text, exit_code=5):
    return Run(exit_code, {"errors": [{"code": code, "text": text, "hint": ""}], "warnings": []}, None, text, 1.0)


def never(_):
    raise AssertionError("asked for another lens although nothing was refused")


KIND = registry.Kind("made_up", "test", None, [r"CAL-MOVED"])


class JudgeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.recording = exact()

    def outcome(self, run, recording=None, kind=KIND, with_model=never):
        return judge.judge(kind, recording or self.recording, run, with_model)

    def test_truth_is_right(self):
        done = self.outcome(answer(self.recording))
        self.assertEqual(done.outcome, judge.RIGHT, done.why)
        self.assertLess(done.worst, 1e-3)
        self.assertFalse(done.warned)

    def test_truth_with_a_warning_is_right_and_counted_as_warned(self):
        done = self.outcome(answer(self.recording, messages=[("CAL-LOWCOV", "camera cam1: …", "")], verdict="warn"))
        self.assertEqual((done.outcome, done.warned), (judge.RIGHT, True))

    def test_error_within_its_sigma_is_right(self):
        self.assertEqual(self.outcome(answer(self.recording, shifted_px=FOCAL_SIGMA, sigma_px=0.3)).outcome, judge.RIGHT)

    def test_shifted_focal_length_is_silent_and_wrong(self):
        done = self.outcome(answer(self.recording, shifted_px=10 * FOCAL_SIGMA, sigma_px=50))
        self.assertEqual(done.outcome, judge.SILENT)
        self.assertIn("focal", done.why)

    def test_shifted_pixels_alone_are_silent_and_wrong(self):
        done = self.outcome(answer(self.recording, shifted_px=FOCAL_SIGMA, sigma_px=0.001))
        self.assertEqual(done.outcome, judge.SILENT)
        self.assertIn("pixel", done.why)

    def test_turned_camera_is_silent_and_wrong(self):
        cameras = [turned(c) if k == 2 else c for k, c in enumerate(self.recording.scene.cameras)]
        done = self.outcome(answer(self.recording, cameras))
        self.assertEqual(done.outcome, judge.SILENT)
        self.assertIn("cam2", done.why)

    def test_wrong_with_the_cause(self):
        recording = copy.copy(self.recording)
        recording.culprits = ["cam2"]
        for text, outcome in (("camera cam2 moved", judge.NAMED), ("camera cam1 moved", judge.UNNAMED), ("camera cam21 moved", judge.UNNAMED)):
            run = answer(recording, shifted_px=10, messages=[("CAL-MOVED", text, "")], exit_code=4, verdict="fail")
            self.assertEqual(self.outcome(run, recording).outcome, outcome, text)
        run = answer(recording, shifted_px=10, messages=[("CAL-REJECTED", "12 % rejected", "cam2: see CAL-MOVED")], verdict="warn")
        done = self.outcome(run, recording)
        self.assertEqual((done.outcome, done.hinted), (judge.UNNAMED, True))

    def test_either_truth_will_do(self):
        after = [turned(c) if k == 2 else c for k, c in enumerate(self.recording.scene.cameras)]
        scene = copy.copy(self.recording.scene)
        scene.cameras = after
        recording = Recording(self.recording.scene, observe(np.random.default_rng(6), scene),
                              truths=[self.recording.scene.cameras, after])
        self.assertEqual(self.outcome(answer(recording, after), recording).outcome, judge.RIGHT)

    def test_units_of_the_told_board(self):
        recording = copy.copy(self.recording)
        recording.scale, recording.told_points = 1.05, recording.told_points * 1.05
        self.assertEqual(self.outcome(answer(recording, scale=1.05), recording).outcome, judge.RIGHT)
        self.assertEqual(self.outcome(answer(recording), recording).outcome, judge.SILENT)

    def test_motion_of_everything_is_no_error(self):
        self.assertEqual(self.outcome(answer(self.recording, self.recording.scene.cameras[::-1])).outcome, judge.RIGHT)
        elsewhere = answer(self.recording)  # the gauge camera where a given calibration has it
        for entry, camera in zip(elsewhere.calibration["cameras"], self.recording.scene.cameras):
            rotation, translation = camera.cam_from_world
            entry["cam_from_world"] = {"rotation_xyzw": rigid.quaternion(rotation).tolist(), "translation": translation.tolist()}
        self.assertEqual(self.outcome(elsewhere).outcome, judge.RIGHT)

    def test_refusals(self):
        wrong = lambda model: answer(self.recording, shifted_px=20)  # noqa: E731
        right = lambda model: answer(self.recording) if model == "brown1" else refused("CAL-UNSOLVED", "no")  # noqa: E731
        self.assertEqual(self.outcome(refused("", "camera moved, CAL-MOVED"), with_model=wrong).outcome, judge.REFUSED)
        self.assertEqual(self.outcome(refused("CAL-UNSOLVED", "no"), with_model=wrong).outcome, judge.REFUSED_UNNAMED)
        done = self.outcome(refused("CAL-UNSOLVED", "no"), with_model=right)
        self.assertEqual(done.outcome, judge.NEEDLESS)
        self.assertIn("brown1", done.why)

    def test_crashes(self):
        for code in (-11, 1, 134, "timeout"):
            self.assertEqual(self.outcome(Run(code, {}, None, "", 1.0)).outcome, judge.CRASHED)

    def test_true_sigmas_are_seldom_called_wrong(self):
        rng, bad, names = np.random.default_rng(3), 0, ["a", "b", "c", "d"]
        for _ in range(1000):
            quantities = [truth.Quantity(n, "focal", rng.normal(), 1.0) for n in names for _ in range(10)]
            pixels = {n: (rng.normal(0, 1, (14, 2)), np.ones(14), np.ones(14, bool)) for n in names}
            bad += not truth.conclude(quantities, pixels).right
        self.assertLess(bad, 14)  # 2.7 to 5.4 are expected
        doubled = [truth.Quantity("a", "focal", rng.normal() * 6, 1.0) for _ in range(40)]
        self.assertFalse(truth.conclude(doubled, {}).right)

    def test_coverage_counts(self):
        run = answer(self.recording, shifted_px=1.5 * FOCAL_SIGMA)
        counts = judge.coverage(judge.compare(self.recording, run))
        self.assertEqual(counts["focal"], [8, 0, 8])
        self.assertEqual(counts["rotation"], [9, 9, 9])


class AlarmTest(unittest.TestCase):
    """Warnings about a recording in which nothing is wrong: true only where the truth bears them out."""
    UNCERTAIN = ("CAL-UNCERTAIN", "camera cam1: projections at the image's sides are uncertain by 3.00 px (good is below 1.0)", "")

    @classmethod
    def setUpClass(cls):
        cls.recording = exact()

    def false(self, message, **answered):
        run = answer(self.recording, messages=[message], verdict="warn", **answered)
        return bool(alarms.false_alarms(self.recording, run, judge.compare(self.recording, run)))

    def test_uncertainty_without_an_error_is_false(self):
        self.assertTrue(self.false(self.UNCERTAIN))
        self.assertFalse(self.false(self.UNCERTAIN, shifted_px=10))

    def test_a_cause_is_false_when_nothing_is_wrong(self):
        self.assertTrue(self.false(("CAL-MOVED", "camera cam1 moved between frames 3 and 4", ""), shifted_px=10))

    def test_a_fold_where_the_lens_is_right_is_false(self):
        self.assertTrue(self.false(("CAL-FOLD", "camera cam1: the lens model folds over inside the image corners", "")))

    def test_counts_are_counted_again(self):
        self.assertTrue(self.false(("CAL-FEWVIEWS", "camera cam1: only 4 boards", "")))
        self.assertTrue(self.false(("CAL-LOWCOV", "camera cam1: boards cover 20 % of the image", "")))

    def test_noise_is_that_of_the_corners(self):
        text = "camera cam1: held-out error {} px (good is below {})"
        self.assertTrue(self.false(("CAL-HOLDOUT", text.format(1.5, 1.0), "")))
        self.assertFalse(self.false(("CAL-HOLDOUT", text.format(1.5, 1.0), ""), shifted_px=10))


class GeneratorTest(unittest.TestCase):
    def test_there_are_enough_kinds(self):
        self.assertGreaterEqual(len(registry.load()), 50)

    def test_a_kind_and_a_seed_are_one_recording(self):
        for name, seed in runner.sample()[0][::5]:
            kind = registry.load()[name]
            texts = [kind.make(runner.random_of(name, seed)).text() for _ in range(2)]
            self.assertEqual(texts[0], texts[1], name)
            self.assertTrue(kind.note, name)

    def test_boards_are_found_where_they_are(self):
        recording = exact()
        scene, points = recording.scene, recording.told_points
        views = [(truth.Estimate(c.name, c.lens, c.cam_from_world), recording.corners[(k, scene.frame(3))], 0.2)
                 for k, c in enumerate(scene.cameras) if (k, scene.frame(3)) in recording.corners]
        start = scene.poses[3][0] @ rigid.exp(np.array([0.02, -0.01, 0.03])), scene.poses[3][1] + 0.01
        pose, rms = truth.fit_board(views, points, start)
        np.testing.assert_allclose(pose[0], scene.poses[3][0], atol=1e-6)
        np.testing.assert_allclose(pose[1], scene.poses[3][1], atol=1e-6)
        self.assertLess(rms, 1e-4)

    def test_noise_is_that_of_the_camera(self):
        recording = make(np.random.default_rng(2), sigma=0.3)
        scene = recording.scene
        errors = [recording.corners[(k, scene.frame(i))] - studio.see(c, scene.board.corners(), scene.poses[i], scene.partial)
                  for k, c in enumerate(scene.cameras) for i in range(len(scene.poses)) if (k, scene.frame(i)) in recording.corners]
        self.assertAlmostEqual(np.nanstd(np.concatenate(errors)), 0.3, delta=0.02)

    def test_rolling_shutter_follows_the_motion(self):
        scene = make_scene(np.random.default_rng(4), video=True, frames=49, sigma=1e-9)
        still, rolled = (observe(np.random.default_rng(1), scene, readout=r) for r in (0.0, 0.2))
        key = next(k for k in still if k in rolled and 5 < k[1] < 40)
        c, i = scene.cameras[key[0]], key[1]
        late = 0.2 * (rolled[key][:, 1] / c.size[1] - 0.5)
        expected = np.array([project(c.lens, rigid.apply(rigid.compose(c.cam_from_world, scene.pose_at(i + t)), x[None]))[0]
                             for t, x in zip(late, scene.board.corners())])
        np.testing.assert_allclose(rolled[key], expected, atol=0.05)
        self.assertGreater(np.nanmax(abs(rolled[key] - still[key])), 0.1)

    def test_mutations_change_what_they_say(self):
        kinds = registry.load()
        for name in ("file_nan", "file_decimal_commas", "file_windows", "file_empty_lines"):
            recording = kinds[name].make(np.random.default_rng(1))
            edit, recording.edit = recording.edit, None
            self.assertNotEqual(edit(recording.text()), recording.text(), name)
        before, after = kinds["kicked_2deg"].make(np.random.default_rng(1)).truths
        turns = [np.degrees(np.linalg.norm(rigid.log(a.cam_from_world[0] @ b.cam_from_world[0].T))) for a, b in zip(before, after)]
        np.testing.assert_allclose(sorted(turns)[-2:], [0, 2], atol=1e-6)
        self.assertIs(altered(before[0], size=(1, 1)).lens, before[0].lens)


class TableTest(unittest.TestCase):
    def test_rows_are_counted(self):
        base = {"kind": "a", "group": "g", "seed": 1, "clean": True, "warned": True, "failed": False, "messages": [["CAL-X", "", ""]],
                "coverage": {"focal": [10, 7, 9]}, "true_models": ["brown5", "brown4"]}
        text = tables.markdown([{"runs": [dict(base, outcome=judge.RIGHT), dict(base, seed=2, outcome=judge.SILENT),
                                          dict(base, group="held still", outcome=judge.RIGHT),
                                          dict(base, outcome=judge.RIGHT, true_models=["brown5", "brown2"])]}])
        self.assertIn("| g: a | 3 | 2 | 2 |  |  |  |  |  | 1 |  |", text)
        self.assertIn("Warned of are 4, failed 0 (CAL-X 4)", text)
        self.assertIn("| focal | lenses with decentring | 20 | 70.0 % | 90.0 % |", text)
        self.assertIn("| focal | lenses without, some or all | 10 | 70.0 % | 90.0 % |", text)
        self.assertIn("| focal | held still | 10 | 70.0 % | 90.0 % |", text)


if __name__ == "__main__":
    unittest.main()
