#include "dataset/pose/pose3d_compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/random.h"
#include "dataset/pose/pose3d_trc.h"

namespace mvstudio::dataset {
namespace {

JointTable RandomTable(int num_frames, uint64_t seed) {
  Rng rng(seed);
  JointTable table;
  for (int f = 0; f < num_frames; ++f) {
    for (const char* joint : {"Nose", "LHip", "RHip", "LKnee"}) {
      JointRow row;
      row.status = Status::kOk;
      row.x_in_world = {rng.Normal(), rng.Normal(), rng.Normal()};
      table[f][0][joint] = row;
    }
  }
  return table;
}

TEST(ComparePose3d, DistancesOfAKnownShift) {
  const JointTable reference = RandomTable(5, 1);
  JointTable pose = reference;
  for (auto& [frame, persons] : pose) {
    for (auto& [name, row] : persons[0]) row.x_in_world += Eigen::Vector3d(0.003, 0, 0.004);
  }
  const Pose3dComparison comparison = ComparePose3d(pose, reference);
  EXPECT_EQ(comparison.num, 20);
  EXPECT_NEAR(comparison.median_mm, 5, 1e-9);
  EXPECT_NEAR(comparison.mean_mm, 5, 1e-9);
  EXPECT_NEAR(comparison.max_mm, 5, 1e-9);
  EXPECT_FALSE(comparison.aligned);
  EXPECT_NEAR(ComparePose3d(pose, reference, true).max_mm, 0, 1e-9);
}

TEST(ComparePose3d, AlignsRigidMotions) {
  const JointTable reference = RandomTable(5, 2);
  JointTable pose = reference;
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
  for (auto& [frame, persons] : pose) {
    for (auto& [name, row] : persons[0]) row.x_in_world = rotation * row.x_in_world + Eigen::Vector3d(1, 2, 3);
  }
  const Pose3dComparison comparison = ComparePose3d(pose, reference, true);
  EXPECT_TRUE(comparison.aligned);
  EXPECT_LT(comparison.max_mm, 1e-9);
}

TEST(ComparePose3d, PicksTheNearestPersonAndCommonJoints) {
  JointTable reference = RandomTable(3, 3);
  JointTable pose = reference;
  for (auto& [frame, persons] : reference) {
    persons[7] = persons[0];
    for (auto& [name, row] : persons[0]) row.x_in_world += Eigen::Vector3d(2, 0, 0);
    persons[7].erase("Nose");
  }
  pose[99] = pose[0];
  const Pose3dComparison comparison = ComparePose3d(pose, reference);
  EXPECT_EQ(comparison.num, 9);
  EXPECT_EQ(comparison.max_mm, 0);
  EXPECT_EQ(ComparePose3d({}, reference).num, 0);
}

TEST(ComparePose3d, CoverageOfSampledErrors) {
  const JointTable reference = RandomTable(1500, 4);
  JointTable pose = reference;
  Rng rng(5);
  Eigen::Matrix3d root;
  root << 0.01, 0, 0, 0.004, 0.02, 0, -0.003, 0.001, 0.005;
  for (auto& [frame, persons] : pose) {
    for (auto& [name, row] : persons[0]) {
      row.x_in_world += root * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
      row.covariance = root * root.transpose();
    }
  }
  const Pose3dComparison comparison = ComparePose3d(pose, reference);
  EXPECT_EQ(comparison.num_covariance, 6000);
  EXPECT_NEAR(comparison.coverage68, 0.68, 0.024);
  EXPECT_NEAR(comparison.coverage95, 0.95, 0.012);
}

TEST(ToCoco19Table, MeansCarryTheirCovariance) {
  Pose3d pose{"coco17", {}};
  for (const char* joint : {"LHip", "RHip"}) {
    JointRow row;
    row.joint = joint;
    row.status = Status::kOk;
    row.covariance = Eigen::Matrix3d(4e-6 * Eigen::Matrix3d::Identity());
    pose.rows.push_back(row);
  }
  const JointTable table = ToCoco19Table(pose);
  const auto& joints = table.at(0).at(0);
  EXPECT_EQ(joints.size(), 3u);
  EXPECT_NEAR((*joints.at("MidHip").covariance)(0, 0), 2e-6, 1e-18);
  EXPECT_NEAR((*joints.at("LHip").covariance)(0, 0), 4e-6, 1e-18);
}

class Trc : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = (std::filesystem::temp_directory_path() / ("mvstudio_" + std::to_string(getpid()) + ".trc")).string();
  }
  void TearDown() override { std::filesystem::remove(path_); }
  void Put(const std::string& content) const { std::ofstream(path_) << content; }
  static std::string Header(const std::string& unit) {
    return "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tUnits\n60\t" + unit +
           "\nFrame#\tTime\tRHip\t\t\tLHip\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n";
  }
  std::string path_;
};

TEST_F(Trc, AxesUnitsAndFrames) {
  Put(Header("mm") + "1\t0.01\t1000\t2000\t3000\t\t\t\n3\t0.03\t1\t2\t3\t4000\t5000\t6000\n");
  const Pose3d pose = ReadTrc(path_);
  ASSERT_EQ(pose.rows.size(), 4u);
  EXPECT_EQ(pose.rows[0].frame, 0);
  EXPECT_EQ(pose.rows[0].joint, "RHip");
  EXPECT_EQ(pose.rows[0].x_in_world, Eigen::Vector3d(3, 1, 2));
  EXPECT_EQ(pose.rows[1].status, Status::kTooFewViews);
  EXPECT_EQ(pose.rows[3].frame, 2);
  EXPECT_EQ(pose.rows[3].x_in_world, Eigen::Vector3d(6, 4, 5));
}

TEST_F(Trc, DamageIsNamed) {
  for (const std::string& content :
       {std::string("a\nb\n"), Header("ell") + "1\t0\t1\t2\t3\n", Header("m"), Header("m") + "x\t0\t1\t2\t3\n"}) {
    Put(content);
    EXPECT_THROW(ReadTrc(path_), FormatError) << content;
  }
  std::filesystem::remove(path_);
  EXPECT_THROW(ReadTrc(path_), IoError);
}

/// A second person whom the reference does not know is compared with nobody, also where the first is missing.
TEST(ComparePose3d, WhoIsNotInTheReferenceIsLeftOut) {
  const JointTable reference = RandomTable(10, 1);
  JointTable pose = reference;
  for (auto& [frame, persons] : pose) {
    persons[5] = persons[0];
    for (auto& [name, row] : persons[5]) row.x_in_world += Eigen::Vector3d(4, 0, 0);
    for (auto& [name, row] : persons[0]) row.x_in_world += Eigen::Vector3d(0, 0.003, 0);
    if (frame == pose.begin()->first) persons.erase(0);
  }
  const Pose3dComparison comparison = ComparePose3d(pose, reference);
  EXPECT_NEAR(comparison.max_mm, 3, 1e-9);
  EXPECT_EQ(comparison.persons_left_out, 1);
  EXPECT_EQ(ComparePose3d(reference, pose).persons_left_out, 0) << "two to choose from";
}

/// Numbers that persons have in the two do not matter, nor that one's number changes.
TEST(ComparePose3d, PairsAreThoseThatAreNear) {
  JointTable reference = RandomTable(10, 1), pose;
  for (auto& [frame, persons] : reference) {
    persons[1] = persons[0];
    for (auto& [name, row] : persons[1]) row.x_in_world += Eigen::Vector3d(1, 0, 0);
    pose[frame][frame % 2 ? 8 : 9] = persons[0];
    pose[frame][frame % 2 ? 9 : 8] = persons[1];
  }
  const Pose3dComparison comparison = ComparePose3d(pose, reference);
  EXPECT_EQ(comparison.max_mm, 0);
  EXPECT_EQ(comparison.persons_left_out, 0);
  EXPECT_EQ(comparison.num, ComparePose3d(reference, reference).num);
}

TEST(ComparePose3d, NamesMeetInAllSpellingsAndNothingIsSaidToBeNothing) {
  const JointTable pose = RandomTable(3, 1);
  JointTable subject, spelled, other, later;
  for (const auto& [frame, persons] : pose) {
    for (const auto& [name, row] : persons.at(0)) {
      subject[frame][0]["anna:" + name] = row, other[frame][0]["x" + name] = row, later[frame + 50][0][name] = row;
    }
    spelled[frame][0]["left_hip"] = persons.at(0).at("LHip"), spelled[frame][0]["nose"] = persons.at(0).at("Nose");
  }
  EXPECT_EQ(ComparePose3d(subject, pose).num, 12);
  EXPECT_EQ(ComparePose3d(pose, subject).max_mm, 0);
  EXPECT_EQ(ComparePose3d(pose, spelled).num, 6);
  EXPECT_EQ(ComparePose3d(pose, spelled).max_mm, 0);
  EXPECT_NE(ComparePose3d(pose, other).why_none.find("no joint has a name"), std::string::npos);
  EXPECT_NE(ComparePose3d(pose, later).why_none.find("frames 0 to 2 here, 50 to 52 there"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::dataset
