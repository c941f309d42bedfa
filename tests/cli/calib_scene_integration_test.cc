#include <fstream>

#include "core/format.h"
#include "core/random.h"
#include "core/units.h"
#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "tests/calib/synthetic.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// Calibration without a board, and calib eval on footage, as a user runs them.
namespace mvstudio::testing {
namespace {

geometry::Rig Truth(int num_cameras) {
  calib::testing::SceneOptions options;
  options.num_cameras = num_cameras;
  options.num_frames = 2;
  return calib::testing::TruthRig(calib::testing::MakeScene(options));
}

/// Marks in front of the cameras, clicked with `noise_px`.
struct Marks {
  Eigen::Matrix3Xd x_in_world;
  std::string places = "point,x,y,z\n", clicks = "camera,point,x_px,y_px\n";
};

Marks MakeMarks(const geometry::Rig& rig, int count, double noise_px, uint64_t seed) {
  Rng rng(seed);
  Marks marks;
  marks.x_in_world.resize(3, 0);
  while (marks.x_in_world.cols() < count) {
    const Eigen::Vector3d in_first(rng.Uniform(-0.6, 0.6), rng.Uniform(-0.45, 0.45), rng.Uniform(0.7, 2.0));
    const Eigen::Vector3d x = geometry::Inverse(rig.cameras[0].cam_from_world) * in_first;
    std::string clicks;
    const auto i = static_cast<int>(marks.x_in_world.cols());
    int seen = 0;
    for (const geometry::RigCamera& camera : rig.cameras) {
      const geometry::Projection p = geometry::Project(camera.camera, camera.cam_from_world * x);
      if (p.status != Status::kOk || !geometry::InImage(camera.camera, p.px)) continue;
      clicks += Format("%s,mark%d,%.6f,%.6f\n", camera.camera.name.c_str(), i, p.px[0] + noise_px * rng.Normal(),
                       p.px[1] + noise_px * rng.Normal());
      ++seen;
    }
    if (seen < static_cast<int>(rig.cameras.size())) continue;
    marks.x_in_world.conservativeResize(3, i + 1);
    marks.x_in_world.col(i) = x;
    marks.places += Format("mark%d,%.9f,%.9f,%.9f\n", i, x[0], x[1], x[2]);
    marks.clicks += clicks;
  }
  return marks;
}

std::string Write(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
  return path;
}

/// Squared Mahalanobis distance of a pose from the truth, by its own covariance.
double Chi2(const geometry::RigCamera& found, const geometry::RigCamera& truth) {
  geometry::Vector6d delta;
  delta.head<3>() = geometry::RotationLog(found.cam_from_world.rotation * truth.cam_from_world.rotation.conjugate());
  delta.tail<3>() = found.cam_from_world.translation - truth.cam_from_world.translation;
  return delta.dot(found.cam_from_world_covariance->ldlt().solve(delta));
}

class ScenePoints : public ::testing::Test {
 protected:
  /// Lenses as they are, poses forgotten.
  std::string WriteLenses() {
    geometry::Rig lenses = truth_;
    for (geometry::RigCamera& camera : lenses.cameras) camera.cam_from_world = geometry::Rigid3();
    geometry::WriteRig(lenses, folder_ / "lenses.json");
    return folder_ / "lenses.json";
  }
  TempDir folder_;
  geometry::Rig truth_ = Truth(3);
};

TEST_F(ScenePoints, EveryCameraIsPlacedWithinItsUncertainty) {
  const std::string lenses = WriteLenses();
  double chi2 = 0;
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const Marks marks = MakeMarks(truth_, 14, 1, seed);
    const CliRun run =
        RunCli({"calibrate", "--start", lenses, "--scene-points", Write(folder_ / "clicks.csv", marks.clicks), "--scene-points",
                Write(folder_ / "places.csv", marks.places), "--out", folder_ / "calib", "--overwrite", "--json"});
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    EXPECT_EQ(run.Json()["metrics"]["gauge"], "the marked points");
    const geometry::Rig found = geometry::ReadRig(folder_ / "calib" + "/calibration.json");
    ASSERT_EQ(found.cameras.size(), 3u);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(run.Json()["metrics"]["cameras"][c]["rms_px"].get<double>(), std::sqrt(2.0), 0.6);
      chi2 += Chi2(found.cameras[c], truth_.cameras[c]);
      EXPECT_LT((found.cameras[c].CenterInWorld() - truth_.cameras[c].CenterInWorld()).norm(), 0.02);
    }
  }
  // 12 poses of 6: mean 72, standard deviation 12.
  EXPECT_GT(chi2, 36);
  EXPECT_LT(chi2, 120);
}

/// Lenses of a library, found by the session's serial numbers, serve as those of --start do.
TEST_F(ScenePoints, LensesOfALibraryServe) {
  geometry::WriteRig(truth_, folder_ / "rig.json");
  std::filesystem::create_directory(folder_ / "session");
  std::ofstream session(folder_ / "session" + "/mvstudio.toml");
  session << "schema = \"mvstudio.session/1\"\nunits = \"m\"\n";
  for (const geometry::RigCamera& camera : truth_.cameras) {
    const std::string name = camera.camera.name;
    session << "[[cameras]]\nname = \"" << name << "\"\nserial = \"s" << name << "\"\n";
    ASSERT_EQ(RunCli({"calib", "lenses", "add", folder_ / "library.json", folder_ / "rig.json", "--camera", name, "--serial",
                      "s" + name, "--setting", "near"})
                  .exit,
              0);
  }
  session.close();
  const Marks marks = MakeMarks(truth_, 8, 0, 9);
  const std::vector<std::string> points = {"--scene-points", Write(folder_ / "clicks.csv", marks.clicks), "--scene-points",
                                           Write(folder_ / "places.csv", marks.places)};
  std::vector<std::string> line = {"calibrate", "--session", folder_ / "session", "--lenses", folder_ / "library.json",
                                   "--json"};
  line.insert(line.end(), points.begin(), points.end());
  const CliRun run = RunCli(line);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["lenses_from_library"].size(), 3u);
  const geometry::Rig found = geometry::ReadRig(folder_ / "session" + "/calib/calibration.json");
  for (size_t c = 0; c < 3; ++c) EXPECT_LT((found.cameras[c].CenterInWorld() - truth_.cameras[c].CenterInWorld()).norm(), 1e-7);
  line = {"calibrate", "--out", folder_ / "none"};
  line.insert(line.end(), points.begin(), points.end());
  EXPECT_EQ(RunCli(line).exit, 2) << "no lenses at all";
}

TEST_F(ScenePoints, WithoutNoiseThePosesAreTheTruth) {
  const Marks marks = MakeMarks(truth_, 8, 0, 9);
  ASSERT_EQ(RunCli({"calibrate", "--start", WriteLenses(), "--scene-points", Write(folder_ / "clicks.csv", marks.clicks),
                    "--scene-points", Write(folder_ / "places.csv", marks.places), "--out", folder_ / "calib"})
                .exit,
            0);
  const geometry::Rig found = geometry::ReadRig(folder_ / "calib" + "/calibration.json");
  for (size_t c = 0; c < 3; ++c) {
    // The clicks are written with six digits.
    EXPECT_LT((found.cameras[c].CenterInWorld() - truth_.cameras[c].CenterInWorld()).norm(), 1e-7);
  }
}

TEST_F(ScenePoints, RigidRigIsPlacedInOnePiece) {
  // The rig as it is, but elsewhere; no camera has four marks of its own.
  geometry::Rig moved = truth_;
  geometry::Rigid3 elsewhere;
  elsewhere.rotation = geometry::RotationExp(Eigen::Vector3d(0.3, -0.5, 1));
  elsewhere.translation = Eigen::Vector3d(4, -2, 1);
  for (geometry::RigCamera& camera : moved.cameras) camera.cam_from_world = camera.cam_from_world * elsewhere;
  geometry::WriteRig(moved, folder_ / "rig.json");
  const Marks marks = MakeMarks(truth_, 9, 0, 4);
  std::istringstream lines(marks.clicks);
  std::string kept, line;
  std::getline(lines, line);
  kept = line + "\n";
  for (int i = 0; std::getline(lines, line); ++i) {
    if (i / 3 % 3 == i % 3) kept += line + "\n";
  }
  const CliRun run =
      RunCli({"calibrate", "--rigid", "--start", folder_ / "rig.json", "--scene-points", Write(folder_ / "clicks.csv", kept),
              "--scene-points", Write(folder_ / "places.csv", marks.places), "--out", folder_ / "calib"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const geometry::Rig found = geometry::ReadRig(folder_ / "calib" + "/calibration.json");
  for (size_t c = 0; c < 3; ++c) EXPECT_LT((found.cameras[c].CenterInWorld() - truth_.cameras[c].CenterInWorld()).norm(), 1e-6);
}

TEST_F(ScenePoints, AWrongClickIsNamed) {
  Marks marks = MakeMarks(truth_, 10, 0.3, 3);
  const size_t at = marks.clicks.find("cam1,mark4,");
  ASSERT_NE(at, std::string::npos);
  const size_t end = marks.clicks.find('\n', at);
  marks.clicks.replace(at, end - at, "cam1,mark4,12,470");
  const CliRun run = RunCli({"calibrate", "--start", WriteLenses(), "--scene-points",
                             Write(folder_ / "clicks.csv", marks.clicks), "--scene-points",
                             Write(folder_ / "places.csv", marks.places), "--out", folder_ / "calib", "--overwrite", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out;
  ASSERT_EQ(run.Json()["warnings"].size(), 2u) << run.out;
  EXPECT_EQ(run.Json()["warnings"][1]["code"], "CAL-COVARIANCE-MISSING") << "the given lenses state none";
  EXPECT_EQ(run.Json()["warnings"][0]["code"], "CAL-CLICK");
  EXPECT_THAT(run.Json()["warnings"][0]["text"].get<std::string>(), HasSubstr("camera cam1: point mark4"));
  EXPECT_EQ(run.Json()["metrics"]["cameras"][1]["num_used"], 9);
}

TEST_F(ScenePoints, ErrorsOfTheCallerAndOfTheMarks) {
  const std::string lenses = WriteLenses(), out = folder_ / "calib";
  const Marks marks = MakeMarks(truth_, 8, 0.3, 3);
  const std::string clicks = Write(folder_ / "clicks.csv", marks.clicks), places = Write(folder_ / "places.csv", marks.places);
  EXPECT_EQ(RunCli({"calibrate", "--scene-points", clicks, "--scene-points", places, "--out", out}).exit, 2);
  EXPECT_EQ(RunCli({"calibrate", "--start", lenses, "--scene-points", folder_ / "none.csv", "--out", out}).exit, 3);
  CliRun run = RunCli({"calibrate", "--start", lenses, "--scene-points", clicks, "--out", out});
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.err, HasSubstr("has no place"));
  run = RunCli({"calibrate", "--start", lenses, "--board", "chessboard:9x6:25mm", "--scene-points", clicks, "--scene-points",
                places, "--out", out});
  EXPECT_EQ(run.exit, 2);
  // Two of the three cameras keep three marks only: the third is placed. Then none is.
  std::string few = "camera,point,x_px,y_px\n", fewer = few;
  std::istringstream lines(marks.clicks);
  std::string line;
  std::getline(lines, line);
  for (int i = 0; std::getline(lines, line); ++i) {
    if (i % 3 == 0 || i < 9) few += line + "\n";
    if (i < 9) fewer += line + "\n";
  }
  run = RunCli({"calibrate", "--start", lenses, "--scene-points", Write(folder_ / "few.csv", few), "--scene-points", places,
                "--out", out, "--overwrite"});
  EXPECT_EQ(run.exit, 6) << run.out << run.err;
  EXPECT_EQ(geometry::ReadRig(out + "/calibration.json").cameras.size(), 1u);
  run = RunCli({"calibrate", "--start", lenses, "--scene-points", Write(folder_ / "few.csv", fewer), "--scene-points", places,
                "--out", out, "--overwrite"});
  EXPECT_EQ(run.exit, 5) << run.out << run.err;
  EXPECT_THAT(run.err, HasSubstr("3 points are marked; at least 4 are needed"));
}

TEST(FromScene, SaysWhatIsMissing) {
  const TempDir folder;
  std::filesystem::create_directories(folder / "images");
  for (const std::string name : {"a", "b"}) dataset::WriteImage(Image(64, 48, 3, 90), folder / ("images/" + name + ".png"));
  const std::vector<std::string> words = {"calibrate", "--from-scene", folder / "images", "--out", folder / "out"};
  const auto with = [&](std::vector<std::string> more) {
    std::vector<std::string> all = words;
    all.insert(all.end(), more.begin(), more.end());
    return RunCli(all);
  };
  EXPECT_EQ(with({}).exit, 2) << "no scale";
  CliRun run = with({"--camera-distance", "a:c:2m"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.err, HasSubstr("no image of a camera 'c'"));
  run = with({"--camera-distance", "a:b:2m", "--colmap", "no-such-program"});
  EXPECT_EQ(run.exit, 8);
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_THAT(run.err, HasSubstr("install COLMAP"));
  if (std::system("command -v colmap >/dev/null 2>&1") != 0) return;
  run = with({"--camera-distance", "a:b:2m"});
  EXPECT_EQ(run.exit, 5) << run.err;
  EXPECT_THAT(run.err, HasSubstr("no two images fit together"));
}

/// Footage of the synthetic studio against its truth, then against a calibration in which one camera stands elsewhere.
TEST(CalibEvalOnVideo, NamesTheBumpedCameraAndHowFarItMoved) {
  const TempDir folder;
  const std::string session = folder / "session", truth = session + "/truth/calibration.json";
  ASSERT_EQ(
      RunCli({"synth", "--out", session, "--cameras", "3", "--board-frames", "24", "--take-frames", "0", "--seed", "3"}).exit,
      0);
  std::vector<std::string> footage = {"--board", "charuco:7x5:140mm:105mm", "--cache", "off", "--json"};
  for (const std::string name : {"cam_01", "cam_02", "cam_03"})
    footage.insert(footage.end(), {"--camera", name + "=" + session + "/raw/board/" + name + ".mp4"});
  const auto eval = [&](const std::string& calibration, std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"calib", "eval", calibration};
    words.insert(words.end(), footage.begin(), footage.end());
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  };
  CliRun run = eval(truth);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["moved"], nlohmann::json::array());
  EXPECT_LT(run.Json()["metrics"]["rms_px"].get<double>(), 0.05);

  geometry::Rig bumped = geometry::ReadRig(truth);
  geometry::RigCamera& camera = bumped.cameras[1];
  const Eigen::Vector3d centre = camera.CenterInWorld();
  camera.cam_from_world.rotation = geometry::RotationExp(Eigen::Vector3d(0, DegToRad(0.3), 0)) * camera.cam_from_world.rotation;
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * (centre + Eigen::Vector3d(0.003, 0, 0.004)));
  geometry::WriteRig(bumped, folder / "bumped.json");
  run = eval(folder / "bumped.json", {"--repair", folder / "repaired.json"});
  EXPECT_EQ(run.exit, 4) << run.out << run.err;
  const nlohmann::json metrics = run.Json()["metrics"], moved = metrics["cameras"][1];
  ASSERT_EQ(metrics["moved"], nlohmann::json({"cam_02"}));
  EXPECT_NEAR(moved["rotation_deg"].get<double>(), 0.3, 4 * moved["rotation_sigma_deg"].get<double>());
  EXPECT_NEAR(moved["translation_mm"].get<double>(), 5, 4 * moved["translation_sigma_mm"].get<double>());
  EXPECT_LT(moved["rotation_sigma_deg"].get<double>(), 0.01);
  EXPECT_LT(moved["translation_sigma_mm"].get<double>(), 0.5);
  EXPECT_EQ(eval(folder / "repaired.json").exit, 0);
}

}  // namespace
}  // namespace mvstudio::testing
