#include <cmath>
#include <filesystem>
#include <fstream>

#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_trc.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton.h"
#include "geometry/skeleton/skeleton_text.h"
#include "tests/support/mouse.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// A mouse with a skeleton of its own, from 2D points to datasets and their exports.
namespace mvstudio::testing {
namespace {

using ::testing::ElementsAreArray;
namespace fs = std::filesystem;

constexpr int kFrames = 40;

class OwnSkeleton : public ::testing::Test {
 protected:
  OwnSkeleton() {
    geometry::WriteRig(rig_, folder_ / "calibration.json");
    WriteToml(MouseToml());
    WritePoints(MouseNames());
  }

  void WriteToml(const std::string& text) const { std::ofstream(folder_ / "mouse.toml") << text; }

  /// 2D points of all joints under other names; one that is empty is left out.
  void WritePoints(const std::vector<std::string>& names) const {
    Rng rng(7);
    std::ofstream csv(folder_ / "points.csv");
    csv << "camera,frame,person,joint,x_px,y_px,score\n";
    for (const geometry::RigCamera& camera : rig_.cameras) {
      for (int f = 0; f < kFrames; ++f) {
        const std::vector<Eigen::Vector3d> x = MouseAt(f);
        for (size_t j = 0; j < x.size(); ++j) {
          const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * x[j]).px;
          if (names[j].empty()) continue;
          csv << camera.camera.name << "," << f << ",0," << names[j] << "," << px.x() + 0.5 * rng.Normal() << ","
              << px.y() + 0.5 * rng.Normal() << ",0.9\n";
        }
      }
    }
  }

  /// Into an empty folder.
  CliRun Triangulate(const std::vector<std::string>& more) const {
    fs::remove_all(folder_ / "out");
    std::vector<std::string> words = {
        "triangulate",   "--calib", folder_ / "calibration.json", "--points2d", folder_ / "points.csv", "--out",
        folder_ / "out", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }

  std::vector<std::string> Toml() const { return {"--skeleton", folder_ / "mouse.toml"}; }

  TempDir folder_;
  geometry::Rig rig_ = triangulate::MakeRing(4);
};

TEST_F(OwnSkeleton, GetsLengthsRefinementAndEveryKindOfFile) {
  const CliRun run =
      Triangulate({"--skeleton", folder_ / "mouse.toml", "--refine", "--to", "trc,c3d,csv,bvh", "--frame-rate", "100"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json m = run.Json()["metrics"];
  EXPECT_EQ(m["num_points"], kFrames * 15);
  ASSERT_EQ(m["limbs"].size(), 14u);
  for (const auto& limb : m["limbs"]) {
    EXPECT_GT(limb["mean_mm"].get<double>(), 30) << limb;
    EXPECT_LT(limb["std_mm"].get<double>(), 5) << limb;
  }
  EXPECT_EQ(m["limbs"][12]["limb"], "tail_base-tail_mid");
  EXPECT_NEAR(m["limbs"][12]["mean_mm"].get<double>(), 200, 1);
  EXPECT_LT(m["limb_std_mm"].get<double>(), 5);
  EXPECT_LE(m["refinement"]["bone_std_mm"]["after"].get<double>(), m["refinement"]["bone_std_mm"]["before"].get<double>());
  EXPECT_THAT(run.out, AllOf(Not(HasSubstr("TRI-LIMBS")), Not(HasSubstr("TRI-NO-BONES")), Not(HasSubstr("TRI-UP"))));
  const nlohmann::json person = m["markers"]["persons"][0];
  EXPECT_EQ(person["joints"].size(), 15u);
  EXPECT_EQ(person["bvh"]["joints"], 15);
  EXPECT_LT(person["bvh"]["rms_mm"].get<double>(), 5);
  EXPECT_EQ(dataset::ReadTrc(folder_ / "out/markers/person0.trc").rows.size(), kFrames * 15u);
  for (const std::string& name : MouseNames()) {
    EXPECT_THAT(Slurp(folder_ / "out/markers/person0.bvh"), HasSubstr(" " + name + "\n"));
    EXPECT_THAT(Slurp(folder_ / "out/markers/person0.c3d"), HasSubstr(name));
    EXPECT_THAT(Slurp(folder_ / "out/markers/person0.csv"), HasSubstr("," + name + ","));
  }
}

TEST_F(OwnSkeleton, IsKnownToLaterCommandsByTheResultAlone) {
  ASSERT_EQ(Triangulate(Toml()).exit, 0);
  fs::remove(folder_ / "mouse.toml");
  const dataset::Pose3d pose = dataset::ReadPose3d(folder_ / "out");
  EXPECT_EQ(pose.skeleton, "mouse");
  const geometry::Skeleton mouse = SkeletonOf(pose);
  EXPECT_THAT(mouse.joints, ElementsAreArray(MouseNames()));
  EXPECT_EQ(mouse.bones.size(), 14u);
  EXPECT_EQ(mouse.pairs.size(), 4u);
  const CliRun run = RunCli({"markers", folder_ / "out", "--to", "bvh", "--frame-rate", "50", "--out", folder_ / "markers"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(Slurp(folder_ / "markers/person0.bvh"), HasSubstr("ROOT back\n"));
}

// As `pose2d` leaves them: folders of cameras, and beside them whose joints they hold.
TEST_F(OwnSkeleton, FoldersSayWhoseJointsTheyHold) {
  WriteToml(MouseToml());
  const geometry::Skeleton mouse = geometry::SkeletonFrom(folder_ / "mouse.toml");
  std::vector<std::string> words = {"triangulate", "--calib", folder_ / "calibration.json", "--out", folder_ / "out", "--json"};
  for (const dataset::Pose2dTrack& track : dataset::ReadPose2dCsv(folder_ / "points.csv", &mouse).tracks) {
    dataset::WriteOpenPoseFolder(track, folder_ / ("pose2d/" + track.camera), &mouse);
    words.insert(words.end(), {"--pose2d", track.camera + "=" + (folder_ / ("pose2d/" + track.camera))});
  }
  EXPECT_EQ(RunCli(words).exit, 3);  // not the 25 joints that are expected
  std::ofstream(folder_ / "pose2d/skeleton.json") << geometry::SkeletonToJson(mouse);
  const CliRun run = RunCli(words);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["limbs"].size(), 14u);
  EXPECT_EQ(dataset::ReadPose3d(folder_ / "out").skeleton, "mouse");
}

TEST_F(OwnSkeleton, ABoneOutsideItsRangeIsNamed) {
  WriteToml(MouseToml("[0.05, 0.1]"));
  const CliRun run = Triangulate(Toml());
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out,
              AllOf(HasSubstr("TRI-LIMBS"), HasSubstr("person 0: tail_base-tail_mid is 200"), HasSubstr("not 50 to 100 mm")));
}

TEST_F(OwnSkeleton, JointsAreMatchedByNameAndTheOthersSaid) {
  std::vector<std::string> names = MouseNames();
  names[14] = "";
  WritePoints(names);
  const CliRun missing = Triangulate(Toml());
  EXPECT_EQ(missing.exit, 0) << missing.err;
  EXPECT_THAT(missing.out, AllOf(HasSubstr("POSE-JOINTS-MISSING"), HasSubstr("skeleton mouse: tail_tip")));
  names[14] = "whisker";
  WritePoints(names);
  const CliRun stranger = Triangulate(Toml());
  EXPECT_EQ(stranger.exit, 3);
  EXPECT_THAT(stranger.out, AllOf(HasSubstr("whisker"), HasSubstr("mouse")));
}

TEST_F(OwnSkeleton, PointsWithoutBonesSayWhatTheyLack) {
  const CliRun run = Triangulate({"--refine", "--to", "trc,bvh", "--frame-rate", "50"});
  EXPECT_EQ(run.exit, 6) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("TRI-NO-BONES"), HasSubstr("MRK-BVH")));
  EXPECT_TRUE(fs::exists(folder_ / "out/markers/person0.trc"));
  EXPECT_FALSE(fs::exists(folder_ / "out/markers/person0.bvh"));
  const CliRun later = RunCli({"markers", folder_ / "out", "--skeleton", folder_ / "mouse.toml", "--to", "bvh", "--frame-rate",
                               "50", "--out", folder_ / "markers"});
  EXPECT_EQ(later.exit, 0) << later.err;
}

TEST_F(OwnSkeleton, HostileFilesEndInOneLine) {
  const std::pair<const char*, const char*> files[] = {
      {"name = \"m\"\njoints = []\n", "joints"},
      {"name = \"m\"\njoints = [\"a\", \"a\"]\n", "joints[1]"},
      {"name = \"m\"\njoints = [\"a\", \"b\"]\nparents = { a = \"b\", b = \"a\" }\n", "parents"},
      {"name = \"m\"\njoints = [\"a\"]\nbones = [[\"a\", \"b\"]]\n", "bones[0][1]"},
      {"name = \"m\"\njoints = [\"a\", \"b\"]\nbones = [{ joints = [\"a\", \"b\"], length_m = [0, nan] }]\n", "length_m[1]"},
      {"\x01\xff", "line 1"}};
  for (const auto& [text, place] : files) {
    WriteToml(text);
    const CliRun run = Triangulate(Toml());
    EXPECT_EQ(run.exit, 3) << text;
    ASSERT_EQ(run.Json()["errors"].size(), 1u) << text;
    const std::string error = run.Json()["errors"][0]["text"].get<std::string>();
    EXPECT_THAT(error, AllOf(HasSubstr("mouse.toml: "), HasSubstr(place), Not(HasSubstr("\n"))));
  }
}

TEST_F(OwnSkeleton, DatasetsKeepEveryJointAndExportIt) {
  ASSERT_EQ(Triangulate({}).exit, 0);  // points: the skeleton comes with dataset build
  std::vector<std::string> words = {"dataset",    "build",
                                    "--calib",    folder_ / "calibration.json",
                                    "--pose3d",   folder_ / "out",
                                    "--skeleton", folder_ / "mouse.toml",
                                    "--out",      folder_ / "dataset",
                                    "--json"};
  for (const geometry::RigCamera& camera : rig_.cameras) {
    const std::string name = camera.camera.name;
    Image image(camera.camera.width_px, camera.camera.height_px, 3);
    for (int f = 0; f < kFrames; ++f) {
      image.Pixel(f, static_cast<int>(name.back() - '0'))[0] = 255;
      dataset::WriteImage(image, folder_ / ("images/" + name + "/" + std::to_string(100 + f).substr(1) + ".png"));
    }
    words.insert(words.end(), {"--images", name + "=" + (folder_ / ("images/" + name + "/*.png"))});
  }
  const CliRun build = RunCli(words);
  ASSERT_EQ(build.exit, 0) << build.out << build.err;
  EXPECT_EQ(build.Json()["metrics"]["skeleton"], "mouse");
  EXPECT_THAT(build.out, HasSubstr("no masks were made"));
  const CliRun verify = RunCli({"dataset", "verify", folder_ / "dataset", "--json"});
  EXPECT_EQ(verify.Json()["metrics"]["num_errors"], 0) << verify.out;
  EXPECT_EQ(verify.Json()["metrics"]["own_frames"], kFrames);
  const dataset::PanopticDataset read = dataset::OpenPanopticDataset(folder_ / "dataset");
  ASSERT_TRUE(read.own);
  EXPECT_THAT(read.own->skeleton.joints, ElementsAreArray(MouseNames()));
  const auto truth = MouseAt(11);
  for (size_t j = 0; j < truth.size(); ++j) {
    const auto& pose = read.own->poses.at(11).at(0);
    ASSERT_TRUE(pose.valid[j]) << j;
    EXPECT_LT((pose.x_in_world.col(static_cast<Eigen::Index>(j)) - truth[j]).norm(), 0.01) << j;
  }
  for (const char* format : {"trc", "c3d", "csv", "bvh", "npz", "ply"}) {
    const CliRun run = RunCli({"dataset", "export", folder_ / "dataset", "--to", format, "--out", folder_ / format, "--json"});
    EXPECT_EQ(run.exit, 0) << format << run.out << run.err;
  }
  for (const std::string& name : MouseNames()) {
    EXPECT_THAT(Slurp(folder_ / "csv/joints.csv"), HasSubstr("," + name + ","));
    EXPECT_THAT(Slurp(folder_ / "bvh/take_person0.bvh"), HasSubstr(" " + name + "\n"));
    EXPECT_THAT(Slurp(folder_ / "trc/take_person0.trc"), HasSubstr(name));
  }
  // A pack has no place for them.
  std::vector<std::string> pack = {"dataset", "pack",  folder_ / "dataset", "--out", folder_ / "pack", "--frames",
                                   "0-3",     "--json"};
  const CliRun refused = RunCli(pack);
  EXPECT_EQ(refused.exit, 3);
  EXPECT_THAT(refused.out, AllOf(HasSubstr("of the 15 joints of 'mouse' are left out"), HasSubstr("--allow-lost-joints")));
  EXPECT_FALSE(fs::exists(folder_ / "pack/INDEX.json"));
  pack.push_back("--allow-lost-joints");
  EXPECT_THAT(RunCli(pack).out, HasSubstr("nothing to pack"));  // nobody is left without them
  const std::string scene = folder_ / "dataset/hdPose3d_stage1_mouse/body3DScene_00000007.json";
  std::ofstream(scene) << "{\"bodies\": [{\"id\": 0, \"joints15\": [1, 2]}]}";
  EXPECT_THAT(RunCli({"dataset", "verify", folder_ / "dataset", "--json"}).out,
              HasSubstr("bodies[0].joints15: must hold 60 numbers"));
}

}  // namespace
}  // namespace mvstudio::testing
