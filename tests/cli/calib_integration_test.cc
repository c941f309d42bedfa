#include <filesystem>

#include "calib/corners/corner_files.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "tests/calib/synthetic.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// calib convert, show, compare and eval as a user runs them.
namespace mvstudio::testing {
namespace {

using calib::testing::Scene;

Scene SceneWith(int num_cameras, geometry::LensModel model = geometry::LensModel::kBrown5) {
  calib::testing::SceneOptions options;
  options.num_cameras = num_cameras;
  options.noise_px = 0.2;
  options.model = model;
  return calib::testing::MakeScene(options);
}

std::string WriteTruth(const TempDir& folder, const Scene& scene) {
  geometry::WriteRig(calib::testing::TruthRig(scene), folder / "truth.json");
  return folder / "truth.json";
}

TEST(CalibConvert, ThereAndBack) {
  const TempDir folder;
  const std::string truth = WriteTruth(folder, SceneWith(3));
  // The others are in tests/calib/formats_roundtrip_test.cc; each run of the program takes a second or two to load.
  for (const std::string format : {"panoptic", "opencv", "mrcal", "colmap", "kalibr"}) {
    SCOPED_TRACE(format);
    const std::string there = folder / format, back = folder / (format + ".json");
    const bool approximate = format == "kalibr";  // has no k3
    std::vector<std::string> words = {"calib", "convert", truth, "--to", format, "--out", there, "--json"};
    if (approximate) words.insert(words.end(), {"--allow-approximation", "0.5"});
    CliRun run = RunCli(words);
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    EXPECT_EQ(run.Json()["metrics"]["format"], format);
    EXPECT_FALSE(run.Json()["outputs"].empty());
    run = RunCli({"calib", "convert", there, "--from", format, "--out", back});
    ASSERT_EQ(run.exit, 0) << run.err;
    if (format == "panoptic") continue;  // its cameras have other names
    run = RunCli({"calib", "compare", back, truth, "--json"});
    ASSERT_EQ(run.exit, 0) << run.err;
    EXPECT_LT(run.Json()["metrics"]["max_rotation_deg"].get<double>(), 1e-6);
    EXPECT_LT(run.Json()["metrics"]["max_translation_mm"].get<double>(), 1e-6);
    EXPECT_LT(run.Json()["metrics"]["max_projection_rms_px"].get<double>(), approximate ? 0.5 : 1e-6);
  }
}

TEST(CalibConvert, ALensThatDoesNotFitIsBadInput) {
  const TempDir folder;
  const std::string truth = WriteTruth(folder, SceneWith(2, geometry::LensModel::kRational8));
  const CliRun run = RunCli({"calib", "convert", truth, "--to", "panoptic", "--out", folder / "p.json", "--json"});
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.out, HasSubstr("--allow-approximation"));
  EXPECT_EQ(
      RunCli({"calib", "convert", truth, "--to", "panoptic", "--out", folder / "p.json", "--allow-approximation", "1"}).exit,
      0);
  EXPECT_EQ(RunCli({"calib", "convert", truth, "--to", "nonsense", "--out", folder / "p.json"}).exit, 2);
}

TEST(CalibShow, TableAndBaselines) {
  const TempDir folder;
  Scene scene = SceneWith(3);
  geometry::Rig rig = calib::testing::TruthRig(scene);
  // The camera stands 10 m from the world's origin; a turn of sigma 1 mrad about its own axes leaves its place alone.
  geometry::RigCamera& camera = rig.cameras[1];
  camera.cam_from_world.translation = {0, 0, 10};
  Eigen::Matrix<double, 6, 3> about_centre;  // rotation w about the camera's own centre: t' = Exp(w) t
  about_centre << Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitY() * -10 * Eigen::RowVector3d::UnitX() +
                                                   Eigen::Vector3d::UnitX() * 10 * Eigen::RowVector3d::UnitY();
  camera.cam_from_world_covariance = 1e-6 * about_centre * about_centre.transpose();
  camera.params_covariance = Eigen::MatrixXd::Identity(camera.camera.params.size(), camera.camera.params.size()) * 0.25;
  geometry::WriteRig(rig, folder / "a.json");
  const nlohmann::json metrics = RunCli({"calib", "show", folder / "a.json", "--json"}).Json()["metrics"];
  const nlohmann::json& shown = metrics["cameras"][1];
  EXPECT_NEAR(shown["sigma_focal_px"].get<double>(), 0.5, 1e-12);
  EXPECT_NEAR(shown["sigma_rotation_deg"].get<double>(), RadToDeg(1e-3), 1e-9);
  EXPECT_NEAR(shown["sigma_position_mm"].get<double>(), 0, 1e-6);
  EXPECT_TRUE(metrics["cameras"][0]["sigma_focal_px"].is_null());
  EXPECT_NEAR(metrics["baselines_m"][0][2].get<double>(),
              (rig.cameras[0].CenterInWorld() - rig.cameras[2].CenterInWorld()).norm(), 1e-12);
  EXPECT_NEAR(shown["fov_deg"][0].get<double>(), 2 * RadToDeg(std::atan(320 / 555.0)), 8);
  EXPECT_THAT(RunCli({"calib", "show", folder / "a.json"}).out, HasSubstr("distances between cameras"));
}

TEST(CalibCompare, FocalLengthAndLimits) {
  const TempDir folder;
  const std::string truth = WriteTruth(folder, SceneWith(3));
  geometry::Rig other = geometry::ReadRig(truth);
  other.cameras[1].camera.params.head<2>() *= 1.01;
  geometry::WriteRig(other, folder / "other.json");
  CliRun run = RunCli({"calib", "compare", folder / "other.json", truth, "--range-m", "2,inf", "--grid", "8", "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const nlohmann::json projection = run.Json()["metrics"]["projection"];
  ASSERT_EQ(projection.size(), 3u);
  EXPECT_LT(projection[0]["ranges"][0]["rms_px"].get<double>(), 1e-9);
  EXPECT_GT(projection[1]["ranges"][1]["rms_px"].get<double>(), 0.3);
  EXPECT_EQ(projection[1]["ranges"][0]["range_m"], 2);
  EXPECT_TRUE(projection[1]["ranges"][1]["range_m"].is_null());
  EXPECT_EQ(projection[1]["ranges"][0]["grid_px"].size(), 6u);
  EXPECT_EQ(projection[1]["ranges"][0]["grid_px"][0].size(), 8u);
  run = RunCli({"calib", "compare", folder / "other.json", truth, "--max-projection-px", "0.1"});
  EXPECT_EQ(run.exit, 4);
  EXPECT_EQ(RunCli({"calib", "compare", truth, truth, "--range-m", "1,x"}).exit, 2);
  // The camera that was turned is the one that differs, and the other two hardly do.
  geometry::Rigid3& pose = other.cameras[1].cam_from_world;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0.02, 0, 0)) * pose.rotation;
  pose.translation = geometry::RotationExp(Eigen::Vector3d(0.02, 0, 0)) * pose.translation;
  geometry::WriteRig(other, folder / "turned.json");
  run = RunCli({"calib", "compare", folder / "turned.json", truth, "--json"});
  const nlohmann::json rotated = run.Json()["metrics"];
  ASSERT_EQ(rotated["cameras"].size(), 3u);
  EXPECT_NEAR(rotated["cameras"][1]["rotation_deg"].get<double>(), rotated["max_rotation_deg"].get<double>(), 1e-9);
  EXPECT_GT(rotated["cameras"][1]["rotation_deg"].get<double>(), 0.5);
  for (const int c : {0, 2}) {
    EXPECT_LT(rotated["cameras"][c]["rotation_deg"].get<double>(), 0.5 * RadToDeg(0.02));
    EXPECT_LE(rotated["cameras"][c]["translation_mm"].get<double>(), rotated["max_translation_mm"].get<double>() + 1e-9);
  }
}

TEST(CalibCompare, WhatBothCovariancesLetExpectIsNoChange) {
  const TempDir folder;
  const auto compare = [&](double sigma_px) {
    geometry::Rig rig = geometry::ReadRig(WriteTruth(folder, SceneWith(3)));
    for (geometry::RigCamera& camera : rig.cameras) {
      const Eigen::Index n = camera.camera.params.size();
      camera.params_covariance = Eigen::MatrixXd::Identity(n, n) * sigma_px * sigma_px * 1e-6;
      camera.params_covariance->topLeftCorner<4, 4>() *= 1e6;
    }
    geometry::WriteRig(rig, folder / "a.json");
    rig.cameras[1].camera.params.head<2>() *= 1.01;
    geometry::WriteRig(rig, folder / "b.json");
    return RunCli({"calib", "compare", folder / "a.json", folder / "b.json", "--json"});
  };
  const CliRun change = compare(0.1), none = compare(100);
  const std::string name = geometry::ReadRig(folder / "b.json").cameras[1].camera.name;
  EXPECT_EQ(change.Json()["metrics"]["differing"], nlohmann::json::array({name})) << change.err;
  EXPECT_EQ(none.Json()["metrics"]["differing"], nlohmann::json::array()) << none.err;
  const CliRun text = RunCli({"calib", "compare", folder / "a.json", folder / "b.json"});
  EXPECT_NE(text.out.find("no camera differs by more than 2 times"), std::string::npos) << text.out;
}

std::string WriteCorners(const TempDir& folder, const Scene& scene) {
  const calib::CalibrateInput input = ToInput(scene);
  calib::CornerFile corners;
  corners.cameras = input.cameras;
  corners.boards = input.boards;
  corners.detections = input.detections;
  calib::WriteCornerFile(corners, folder / "corners.csv");
  return folder / "corners.csv";
}

TEST(TradeoffCalibrate, MeasuresEveryWayAndMarksTheFront) {
  const TempDir folder;
  const std::string corners = WriteCorners(folder, SceneWith(4));
  const std::vector<std::string> words = {"tradeoff",        "calibrate", "--corners", corners, "--models",
                                          "brown5,nonsense", "--views",   "0,8,2",     "--out", folder / "out"};
  std::vector<std::string> as_json = words;
  as_json.emplace_back("--json");
  const CliRun run = RunCli(as_json);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json trials = run.Json()["metrics"]["trials"];
  ASSERT_EQ(trials.size(), 6u);
  int on_front = 0;
  for (const nlohmann::json& trial : trials) {
    if (trial["model"] == "nonsense") {
      EXPECT_TRUE(trial["holdout_px"].is_null()) << trial;
      EXPECT_THAT(trial["status"].get<std::string>(), HasSubstr("--model nonsense")) << "a flag, not an option's name";
      EXPECT_FALSE(trial["on_front"].get<bool>());
    } else if (trial["views"] != 2) {
      EXPECT_LT(trial["holdout_px"].get<double>(), 1) << trial;
    }
    on_front += trial["on_front"].get<bool>();
  }
  EXPECT_GE(on_front, 1);
  EXPECT_THAT(Slurp(folder / "out/tradeoff-calibrate.html"), HasSubstr("<h1>mvstudio tradeoff calibrate</h1>"));
  EXPECT_THAT(RunCli(words).out, ::testing::Not(HasSubstr("nan")));
  EXPECT_EQ(RunCli({"tradeoff", "calibrate", "--corners", corners, "--views", "-3"}).exit, 2);
}

TEST(CalibEval, NamesTheBumpedCameraAndRepairs) {
  const TempDir folder;
  const Scene scene = SceneWith(4);
  const std::string truth = WriteTruth(folder, scene), corners = WriteCorners(folder, scene);
  CliRun run = RunCli({"calib", "eval", truth, "--corners", corners, "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["verdict"]["status"], "pass");
  EXPECT_LT(run.Json()["metrics"]["board_edge_mm"]["rms"].get<double>(), 1);
  run = RunCli({"calib", "eval", truth, "--corners", corners, "--repair", folder / "same.json"});
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("no camera has moved: nothing to repair"));
  EXPECT_FALSE(std::filesystem::exists(folder / "same.json"));

  geometry::Rig bumped = geometry::ReadRig(truth);
  geometry::Rigid3& pose = bumped.cameras[2].cam_from_world;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, DegToRad(0.2), 0)) * pose.rotation;
  geometry::WriteRig(bumped, folder / "bumped.json");
  run = RunCli({"calib", "eval", folder / "bumped.json", "--corners", corners, "--repair", folder / "repaired.json", "--json"});
  EXPECT_EQ(run.exit, 4) << run.out;
  const nlohmann::json metrics = run.Json()["metrics"];
  ASSERT_EQ(metrics["moved"], nlohmann::json({"cam2"}));
  EXPECT_NEAR(metrics["cameras"][2]["rotation_deg"].get<double>(), 0.2,
              3 * metrics["cameras"][2]["rotation_sigma_deg"].get<double>());
  EXPECT_EQ(RunCli({"calib", "eval", folder / "repaired.json", "--corners", corners}).exit, 0);
  EXPECT_THAT(RunCli({"calib", "eval", folder / "bumped.json", "--corners", corners}).err, HasSubstr("camera cam2 has moved"));
}

/// Calibrate, bump, repair, refine with held lenses: covariances come along, and what lacks one is named.
TEST(CalibCovariance, IsCarriedByRepairAndRefine) {
  const TempDir folder;
  const Scene scene = SceneWith(3);
  const std::string corners = WriteCorners(folder, scene);
  ASSERT_EQ(RunCli({"calibrate", "--corners", corners, "--model", "brown4", "--out", folder / "run"}).exit, 0);
  geometry::Rig rig = geometry::ReadRig(folder / "run" + "/calibration.json");
  ASSERT_TRUE(geometry::HasJointCovariance(rig));
  rig.cameras[2].cam_from_world.rotation =
      geometry::RotationExp(Eigen::Vector3d(0, DegToRad(0.5), 0)) * rig.cameras[2].cam_from_world.rotation;
  geometry::WriteRig(rig, folder / "bumped.json");
  CliRun run =
      RunCli({"calib", "eval", folder / "bumped.json", "--corners", corners, "--repair", folder / "repaired.json", "--json"});
  EXPECT_FALSE(run.Json()["metrics"]["calibration_covariance"]["used"]);
  EXPECT_TRUE(run.Json()["metrics"]["covariance_missing"].empty()) << run.out;
  const geometry::Rig repaired = geometry::ReadRig(folder / "repaired.json");
  EXPECT_TRUE(geometry::HasJointCovariance(repaired));
  ASSERT_TRUE(repaired.cameras[2].cam_from_world_covariance);

  run = RunCli({"calib", "refine", "--calib", folder / "repaired.json", "--fix", "lenses", "--corners", corners, "--out",
                folder / "held", "--json"});
  EXPECT_TRUE(run.Json()["metrics"]["covariance_missing"].empty()) << run.out;
  const geometry::Rig held = geometry::ReadRig(folder / "held" + "/calibration.json");
  EXPECT_LT((*held.cameras[1].params_covariance - *repaired.cameras[1].params_covariance).norm(),
            1e-6 * repaired.cameras[1].params_covariance->norm());

  rig.cameras[1].params_covariance.reset();
  geometry::WriteRig(rig, folder / "partial.json");
  run = RunCli({"calib", "refine", "--calib", folder / "partial.json", "--fix", "lenses", "--corners", corners, "--out",
                folder / "part", "--json"});
  EXPECT_EQ(run.Json()["metrics"]["covariance_missing"], nlohmann::json({"cam1"})) << run.out;
  EXPECT_TRUE(run.Json()["metrics"]["cameras"][1]["focal_sigma_px"].is_null());
  const geometry::Rig partial = geometry::ReadRig(folder / "part" + "/calibration.json");
  EXPECT_FALSE(partial.cameras[1].params_covariance) << "unknown, not zero";
  EXPECT_LT(partial.cameras[1].cam_from_world_covariance->trace(), held.cameras[1].cam_from_world_covariance->trace());
}

TEST(CalibEval, ErrorsOfTheCaller) {
  const TempDir folder;
  const Scene scene = SceneWith(2);
  const std::string truth = WriteTruth(folder, scene), corners = WriteCorners(folder, scene);
  EXPECT_EQ(RunCli({"calib", "eval", truth}).exit, 2);
  EXPECT_EQ(RunCli({"calib", "eval", truth, "--corners", corners, "--camera", "a=b"}).exit, 2);
  EXPECT_EQ(RunCli({"calib", "eval", folder / "none.json", "--corners", corners}).exit, 3);
  geometry::Rig renamed = geometry::ReadRig(truth);
  renamed.cameras[0].camera.name = "other";
  geometry::WriteRig(renamed, folder / "renamed.json");
  const CliRun run = RunCli({"calib", "eval", folder / "renamed.json", "--corners", corners});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.err, HasSubstr("cam0 is not in the calibration"));
}

}  // namespace
}  // namespace mvstudio::testing
