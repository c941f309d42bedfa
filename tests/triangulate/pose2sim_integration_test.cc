#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>

#include "dataset/pose2d.h"
#include "dataset/pose3d_compare.h"
#include "dataset/pose3d_trc.h"
#include "tests/triangulate/support.h"
#include "triangulate/limbs.h"
#include "triangulate/take.h"

/// Real recordings of Pose2Sim's demo session against the .trc files that program wrote (a peer's output, not independent
/// truth).
namespace mvstudio::triangulate {
namespace {

namespace fs = std::filesystem;

std::vector<double> Numbers(std::string text) {
  for (char& c : text) {
    if (c == '[' || c == ']' || c == ',') c = ' ';
  }
  std::istringstream stream(text);
  std::vector<double> numbers;
  for (double value; stream >> value;) numbers.push_back(value);
  return numbers;
}

/// The few keys of the session's Calib_qualisys.toml.
geometry::Rig ReadCalibration(const fs::path& path) {
  geometry::Rig rig;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const size_t equals = line.find(" = ");
    if (line.rfind("[cam_", 0) == 0) {
      rig.cameras.emplace_back();
      rig.cameras.back().camera.name = line.substr(1, 6);
    }
    if (equals == std::string::npos || rig.cameras.empty() || line.rfind("adjusted", 0) == 0) continue;
    const std::string key = line.substr(0, equals);
    const std::vector<double> v = Numbers(line.substr(equals + 3));
    geometry::RigCamera& camera = rig.cameras.back();
    if (key == "size") camera.camera.width_px = static_cast<int>(v[0]), camera.camera.height_px = static_cast<int>(v[1]);
    if (key == "matrix") camera.camera.params = (Eigen::VectorXd(8) << v[0], v[4], v[2], v[5], 0, 0, 0, 0).finished();
    if (key == "distortions") camera.camera.params.tail<4>() << v[0], v[1], v[2], v[3];
    if (key == "rotation") camera.cam_from_world.rotation = geometry::RotationExp({v[0], v[1], v[2]});
    if (key == "translation") camera.cam_from_world.translation = {v[0], v[1], v[2]};
    camera.camera.model = geometry::LensModel::kBrown4;
  }
  return rig;
}

struct Session {
  geometry::Rig rig;
  std::vector<DetectedFrame> frames;
  dataset::JointTable reference;
};

Session Load(const fs::path& root, const std::string& trial, const std::string& poses, const std::string& trc) {
  Session session{ReadCalibration(root / "calibration" / "Calib_qualisys.toml"), {}, {}};
  std::map<int, DetectedFrame> frames;
  for (size_t c = 0; c < 4; ++c) {
    const std::string folder = (root / trial / poses / ("cam0" + std::to_string(c + 1) + "_json")).string();
    const auto track = dataset::ReadOpenPoseFolder(folder, session.rig.cameras[c].camera.name, body::SkeletonByName("body25b"));
    for (const auto& [number, people] : track.frames) {
      frames[number].frame = number;
      frames[number].people.resize(4);
      for (const dataset::Person2d& person : people) {
        DetectedPerson& detected = frames[number].people[c].emplace_back();
        for (const auto& key : person.keypoints) detected.push_back({{key.x_px, key.y_px}, key.score});
      }
    }
  }
  for (auto& [number, frame] : frames) session.frames.push_back(frame);
  session.reference = dataset::ToTable(dataset::ReadTrc((root / trial / "pose-3d" / trc).string()).rows);
  return session;
}

dataset::Pose3dComparison Compare(const Session& session, const TakeOptions& options, TakeResult* take = nullptr) {
  const TakeResult result = TriangulateTake(session.rig, session.frames, 25, options);
  dataset::JointTable table;
  for (const TakePoint& entry : result.points) {
    if (entry.point.status != Status::kOk) continue;
    dataset::JointRow row;
    row.x_in_world = entry.point.x_in_world;
    table[entry.frame][entry.person][body::SkeletonByName("body25b").joints[entry.joint_idx]] = row;
  }
  if (take) *take = result;
  return dataset::ComparePose3d(table, session.reference);
}

class Pose2Sim : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = DataFolder() / "pose2sim";
    if (!fs::exists(root_)) GTEST_SKIP() << "data set pose2sim is not there";
  }
  Session Balancing(const std::string& poses = "pose-associated") const {
    return Load(root_, "balancing", poses, "S00_P00_T01_BalancingTrial_0-100.trc");
  }
  Session Static() const { return Load(root_, "static", "pose-associated", "S00_P00_T00_StaticTrial_0-12.trc"); }
  fs::path root_;
};

TEST_F(Pose2Sim, ExhaustiveDltReproducesItsPoints) {
  TakeOptions options;
  options.method = "exhaustive-dlt";
  const auto balancing = Compare(Balancing(), options);
  EXPECT_EQ(balancing.num, 2094);
  EXPECT_LT(balancing.max_mm, 1e-3);
  const auto still = Compare(Static(), options);
  EXPECT_EQ(still.num, 252);
  EXPECT_LT(still.max_mm, 1e-3);
}

std::vector<std::pair<int, int>> Limbs() {
  const body::Skeleton& skeleton = body::SkeletonByName("body25b");
  std::vector<std::pair<int, int>> limbs;
  for (const auto& [a, b] : {std::pair("Shoulder", "Elbow"), {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}}) {
    for (const std::string side : {"L", "R"}) limbs.emplace_back(skeleton.Find(side + a), skeleton.Find(side + b));
  }
  return limbs;
}

TEST_F(Pose2Sim, DefaultBeatsItOnCamerasLeftOutAndOnLimbLengths) {
  TakeOptions peer_options;
  peer_options.method = "exhaustive-dlt";
  TakeResult ours, peer;
  Compare(Balancing(), {}, &ours);
  Compare(Balancing(), peer_options, &peer);
  EXPECT_NEAR(1000 * MeanLimbStd(MeasureLimbs(peer.points, Limbs())), 22.2, 0.05) << "the figure measured elsewhere";
  EXPECT_LT(1000 * MeanLimbStd(MeasureLimbs(ours.points, Limbs())), 22.2);
  const double gain_px = peer.holdout.all.median_px - ours.holdout.all.median_px;
  EXPECT_GT(gain_px, 2 * std::hypot(peer.holdout.all.median_error_px, ours.holdout.all.median_error_px));
  EXPECT_GE(ours.holdout.all.coverage, peer.holdout.all.coverage);
}

TEST_F(Pose2Sim, DefaultStaysWithinTenMillimetres) {
  const auto balancing = Compare(Balancing(), {});
  EXPECT_GE(balancing.num, 2090);
  EXPECT_LT(balancing.median_mm, 10);
  EXPECT_LT(Compare(Static(), {}).median_mm, 10);
}

TEST_F(Pose2Sim, PicksThePersonAmongPassersBy) {
  TakeResult take;
  const auto comparison = Compare(Balancing("pose"), {}, &take);
  EXPECT_EQ(take.num_persons, 1);
  EXPECT_GE(comparison.num, 2080);
  EXPECT_LT(comparison.median_mm, 10);
}

TEST_F(Pose2Sim, NamesTheCamerasThatAreOff) {
  TakeResult take;
  Compare(Balancing(), {}, &take);
  // Means over the views that Pose2Sim kept, measured with another program: (+8.9, +0.4), (-3.4, -2.6), (+8.5, +9.5), (+1.9,
  // -2.1).
  EXPECT_TRUE(take.cameras[0].off);
  EXPECT_TRUE(take.cameras[2].off);
  EXPECT_NEAR(take.cameras[0].mean_residual_px.x(), 8.9, 5);
  EXPECT_NEAR(take.cameras[2].mean_residual_px.x(), 8.5, 5);
  EXPECT_NEAR(take.cameras[2].mean_residual_px.y(), 9.5, 5);
  EXPECT_LT(take.cameras[1].mean_residual_px.norm(), take.cameras[2].mean_residual_px.norm());
}

}  // namespace
}  // namespace mvstudio::triangulate
