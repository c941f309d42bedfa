#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/mouse.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// `dataset build --pose3d` from files of markers, as `markers` writes them.
namespace mvstudio::testing {
namespace {

using ::testing::ElementsAreArray;
using ::testing::UnorderedElementsAreArray;

constexpr int kFrames = 5;

class MarkerDataset : public ::testing::Test {
 protected:
  MarkerDataset() {
    geometry::WriteRig(rig_, folder_ / "calibration.json");
    for (const geometry::RigCamera& camera : rig_.cameras) {
      for (int f = 0; f < kFrames; ++f) {
        dataset::WriteImage(Image(camera.camera.width_px, camera.camera.height_px, 3, static_cast<uint8_t>(40 + f)),
                            folder_ / ("images/" + camera.camera.name + "/" + std::to_string(100 + f).substr(1) + ".png"));
      }
    }
  }

  /// The joints of a person or an animal at these places, as files of markers.
  void WriteMarkers(const std::vector<std::string>& names, const std::vector<std::string>& more = {}) const {
    dataset::Pose3d pose;
    pose.skeleton = "points";
    for (int f = 0; f < kFrames; ++f) {
      for (size_t j = 0; j < names.size(); ++j) {
        dataset::JointRow row;
        row.frame = f, row.joint = names[j], row.status = Status::kOk, row.num_views = 3, row.x_in_world = At(f, j);
        pose.rows.push_back(row);
      }
    }
    dataset::WritePose3d(pose, folder_ / "points");
    std::vector<std::string> words = {"markers", folder_ / "points",  "--to",       "trc,c3d", "--frame-rate", "30",
                                      "--out",   folder_ / "markers", "--overwrite"};
    words.insert(words.end(), more.begin(), more.end());
    const CliRun run = RunCli(words);
    ASSERT_EQ(run.exit, 0) << run.err;
  }

  static Eigen::Vector3d At(int frame, size_t joint) {
    return {0.05 * static_cast<double>(joint) - 0.4, 0.02 * frame, 0.3 + 0.06 * static_cast<double>(joint)};
  }

  CliRun Build(const std::string& markers, const std::vector<std::string>& more = {}) const {
    std::filesystem::remove_all(folder_ / "dataset");
    std::vector<std::string> words = {"dataset",    "build", "--calib", folder_ / "calibration.json",
                                      "--pose3d",   markers, "--out",   folder_ / "dataset",
                                      "--no-masks", "--json"};
    for (const geometry::RigCamera& camera : rig_.cameras) {
      words.insert(words.end(),
                   {"--images", camera.camera.name + "=" + (folder_ / ("images/" + camera.camera.name + "/*.png"))});
    }
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }

  /// Largest distance of the dataset's own joints from where they were.
  double WorstM(const std::vector<std::string>& names) const {
    const dataset::PanopticDataset read = dataset::OpenPanopticDataset(folder_ / "dataset");
    if (!read.own) return INFINITY;
    EXPECT_THAT(read.own->skeleton.joints, UnorderedElementsAreArray(names));
    double worst = 0;
    for (int f = 0; f < kFrames; ++f) {
      const dataset::JointsPose& pose = read.own->poses.at(f).at(0);
      for (size_t j = 0; j < names.size(); ++j) {
        const auto& joints = read.own->skeleton.joints;
        const auto at = std::find(joints.begin(), joints.end(), names[j]) - joints.begin();
        if (!pose.valid[static_cast<size_t>(at)]) return INFINITY;
        worst = std::max(worst, (pose.x_in_world.col(at) - At(f, j)).norm());
      }
    }
    return worst;
  }

  TempDir folder_;
  geometry::Rig rig_ = triangulate::MakeRing(3);
};

TEST_F(MarkerDataset, EveryMarkerArrivesInItsPlaceAndTheUnitIsSaid) {
  WriteMarkers(MouseNames());
  for (const auto& [file, up] : {std::pair("person0.trc", "y"), {"person0.c3d", "z"}}) {
    const CliRun run = Build(folder_ / ("markers/" + std::string(file)));
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    EXPECT_EQ(run.Json()["metrics"]["markers"]["unit"], "mm");
    EXPECT_EQ(run.Json()["metrics"]["markers"]["up"], up);
    EXPECT_EQ(run.Json()["metrics"]["joints_beside"].size(), MouseNames().size());
    EXPECT_LT(WorstM(MouseNames()), 1e-6) << file;
    EXPECT_EQ(RunCli({"dataset", "verify", folder_ / "dataset", "--json"}).Json()["metrics"]["num_errors"], 0);
  }
}

TEST_F(MarkerDataset, PeoplesToesStandBesidePanopticsNineteen) {
  const std::vector<std::string> names = {"Neck",  "Nose",  "MidHip", "LShoulder", "RShoulder", "LHip", "RHip",
                                          "LKnee", "RKnee", "LAnkle", "RAnkle",    "LBigToe",   "RHeel"};
  WriteMarkers(names, {"--trc-unit", "m"});
  const CliRun run = Build(folder_ / "markers/person0.trc");
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_EQ(run.Json()["metrics"]["markers"]["unit"], "m");
  EXPECT_THAT(run.out, Not(HasSubstr("DAT-UNIT")));
  EXPECT_LT(WorstM(names), 1e-6);
  const dataset::PanopticDataset read = dataset::OpenPanopticDataset(folder_ / "dataset");
  EXPECT_LT((read.poses.at(2).at(0).x_in_world.col(0) - At(2, 0)).norm(), 1e-6);  // Neck
}

TEST_F(MarkerDataset, AWrongUnitIsDoubtedAndCanBeNamed) {
  WriteMarkers(MouseNames());
  std::string text = ReadFile(folder_ / "markers/person0.trc");
  text.replace(text.find("\tmm\t"), 4, "\tm\t");
  std::ofstream(folder_ / "wrong.trc") << text;
  const CliRun doubted = Build(folder_ / "wrong.trc");
  EXPECT_THAT(doubted.out, HasSubstr("DAT-UNIT"));
  EXPECT_THAT(doubted.out, HasSubstr("read in m, the points of one time step lie over"));
  const CliRun named = Build(folder_ / "wrong.trc", {"--marker-unit", "mm"});
  ASSERT_EQ(named.exit, 0) << named.out;
  EXPECT_THAT(named.out, Not(HasSubstr("DAT-UNIT")));
  EXPECT_LT(WorstM(MouseNames()), 1e-6);
  EXPECT_EQ(Build(folder_ / "wrong.trc", {"--marker-unit", "ell"}).exit, 2);
}

}  // namespace
}  // namespace mvstudio::testing
