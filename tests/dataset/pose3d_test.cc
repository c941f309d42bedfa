#include "dataset/pose/pose3d.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class Pose3dFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / ("mvstudio_pose3d_" + std::to_string(getpid()) + "_" + info->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Path(const char* name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

JointRow OkRow(const std::string& joint, const Eigen::Vector3d& x, double sigma_m = 0.004) {
  JointRow row;
  row.joint = joint;
  row.status = Status::kOk;
  row.x_in_world = x;
  row.num_views = 4;
  row.rms_px = 1.25;
  row.sigma_m = sigma_m;
  return row;
}

Pose3d RandomPose(uint64_t seed) {
  Rng rng(seed);
  Pose3d pose{"body25", {}};
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  for (int frame = 0; frame < 4; ++frame) {
    for (const std::string& joint : skeleton.joints) {
      JointRow row = OkRow(joint, {rng.Normal() / 3, rng.Normal() * 1e-9, rng.Normal() * 1e6}, rng.Uniform());
      row.frame = frame * 100;
      row.person = static_cast<int>(seed % 2);
      if (rng.Uniform() < 0.2) {
        row.status = Status::kLowParallax;
        row.x_in_world.setZero();
      } else if (rng.Uniform() < 0.8) {
        const Eigen::Matrix3d a = Eigen::Matrix3d::NullaryExpr([&] { return rng.Normal(); });
        const Eigen::Matrix3d c = a * a.transpose() * 1e-6;
        row.covariance = Eigen::Matrix3d(c.selfadjointView<Eigen::Upper>());
      }
      pose.rows.push_back(row);
    }
  }
  return pose;
}

TEST_F(Pose3dFile, RoundTripIsExact) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Pose3d pose = RandomPose(seed);
    WritePose3d(pose, folder_.string());
    const Pose3d read = ReadPose3d(folder_.string());
    EXPECT_EQ(read.skeleton, pose.skeleton);
    ASSERT_EQ(read.rows.size(), pose.rows.size());
    for (size_t i = 0; i < pose.rows.size(); ++i) {
      const JointRow &a = pose.rows[i], &b = read.rows[i];
      EXPECT_EQ(a.frame, b.frame);
      EXPECT_EQ(a.person, b.person);
      EXPECT_EQ(a.joint, b.joint);
      EXPECT_EQ(a.status, b.status);
      EXPECT_EQ(a.x_in_world, b.x_in_world);
      EXPECT_EQ(a.num_views, b.num_views);
      EXPECT_EQ(a.rms_px, b.rms_px);
      EXPECT_EQ(a.sigma_m, b.sigma_m);
      ASSERT_EQ(a.covariance.has_value(), b.covariance.has_value());
      EXPECT_TRUE(!a.covariance || *a.covariance == *b.covariance);
    }
  }
}

TEST_F(Pose3dFile, TableIsTheContractsOne) {
  Pose3d pose{"body25", {OkRow("RHip", {1, -0.5, 0.25})}};
  JointRow missing;
  missing.joint = "LBigToe";
  missing.num_views = 1;
  pose.rows.push_back(missing);
  WritePose3d(pose, folder_.string());
  EXPECT_EQ(ReadFile(Path("points.csv")),
            "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n"
            "0,0,RHip,Ok,1,-0.5,0.25,4,1.25,0.004\n"
            "0,0,LBigToe,TooFewViews,,,,1,0,0\n");
}

TEST_F(Pose3dFile, DamageIsNamedWithItsLine) {
  WritePose3d(RandomPose(1), folder_.string());
  const std::string whole = ReadFile(Path("points.csv"));
  const auto message = [&](const std::string& content) -> std::string {
    std::ofstream(Path("points.csv")) << content;
    try {
      ReadPose3d(folder_.string());
    } catch (const FormatError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message("frame,person\n"), HasSubstr("line 1"));
  EXPECT_THAT(message(whole + "5,0,RHip,Ok,1,2\n"), HasSubstr("line 102: 6 columns"));
  EXPECT_THAT(message(whole + "5,0,RHip,Fine,1,2,3,4,5,6\n"), HasSubstr("unknown status `Fine`"));
  EXPECT_THAT(message(whole + "5,0,RHip,Ok,1,x,3,4,5,6\n"), HasSubstr("column 6"));
  EXPECT_THAT(message(whole + "5,0,RHip,Ok,1,,3,4,5,6\n"), HasSubstr("column 6"));
  EXPECT_THAT(message(whole + "5,0,RHip,Ok,1,nan,3,4,5,6\n"), HasSubstr("not finite"));
  EXPECT_EQ(message(whole), "accepted");
  std::ofstream(Path("pose3d.json")) << "{}";
  EXPECT_THROW(ReadPose3d(folder_.string()), FormatError);
}

TEST_F(Pose3dFile, NonFinitePointIsTheCallersMistake) {
  Pose3d pose{"body25", {OkRow("RHip", {std::numeric_limits<double>::quiet_NaN(), 0, 0})}};
  EXPECT_THROW(WritePose3d(pose, folder_.string()), ContractViolation);
  EXPECT_FALSE(fs::exists(Path("points.csv")));
}

TEST(ToCoco19, TakesOwnJointsAndMeans) {
  Pose3d pose{"body25b",
              {OkRow("LShoulder", {1, 0, 0}, 0.01), OkRow("RShoulder", {3, 2, 0}, 0.01), OkRow("Neck", {9, 9, 9}),
               OkRow("LHip", {0, 0, 1}), OkRow("Nose", {0, 0, 2}, 0.05)}};
  pose.rows.push_back(OkRow("RHip", {5, 5, 5}));
  pose.rows.back().status = Status::kOutlier;
  const Coco19Pose coco = ToCoco19(pose).at(0).at(0);
  ASSERT_TRUE(coco.valid[0]);
  EXPECT_EQ(coco.x_in_world.col(0), Eigen::Vector3d(2, 1, 0));  // the mean of the shoulders, not the upper neck
  EXPECT_NEAR(coco.confidence[0], std::exp(-0.01 / std::sqrt(2.0) / 0.05), 1e-15);
  ASSERT_TRUE(coco.valid[1]);
  EXPECT_NEAR(coco.confidence[1], std::exp(-1.0), 1e-15);
  EXPECT_FALSE(coco.valid[2]);  // one hip is missing: no BodyCenter
  EXPECT_TRUE(coco.valid[6]);
  EXPECT_FALSE(coco.valid[12]);  // an outlier
  EXPECT_EQ(coco.confidence[12], 0);
}

TEST(ToCoco19, FreePointsGiveWhatTheirNamesSay) {
  Pose3d pose{"points", {}};
  for (const char* joint : {"tail", "Nose", "LHip", "RHip"}) {
    JointRow& row = pose.rows.emplace_back();
    row.joint = joint, row.status = Status::kOk;
    row.x_in_world = Eigen::Vector3d::Constant(static_cast<double>(pose.rows.size()));
  }
  EXPECT_THAT(SkeletonOf(pose).joints, ::testing::ElementsAre("tail", "Nose", "LHip", "RHip"));
  const Coco19Pose coco = ToCoco19(pose).at(0).at(0);
  EXPECT_FALSE(coco.valid[0]);                        // Neck
  EXPECT_EQ(coco.x_in_world.col(1).x(), 2);           // Nose
  EXPECT_DOUBLE_EQ(coco.x_in_world.col(2).y(), 3.5);  // between the hips
}

TEST(ToCoco19, KeepsFramesAndPeopleApart) {
  Pose3d pose{"coco17", {OkRow("Nose", {0, 0, 1}), OkRow("Nose", {0, 0, 2}), OkRow("Nose", {0, 0, 3})}};
  pose.rows[1].person = 1;
  pose.rows[2].frame = 9;
  const auto frames = ToCoco19(pose);
  EXPECT_EQ(frames.at(0).at(1).x_in_world(2, 1), 2);
  EXPECT_EQ(frames.at(9).at(0).x_in_world(2, 1), 3);
  EXPECT_EQ(frames.size(), 2u);
}

}  // namespace
}  // namespace mvstudio::dataset
