#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

Rig TwoCamerasWithCovariance() {
  Rig rig;
  for (const char* name : {"a", "b"}) {
    RigCamera camera;
    camera.camera = MakePinhole(name, 640, 480, 500);
    camera.cam_from_world.translation.x() = rig.cameras.empty() ? 0.0 : 1.0;
    rig.cameras.push_back(camera);
  }
  Eigen::MatrixXd root(20, 20);
  for (Eigen::Index i = 0; i < 400; ++i) root.data()[i] = static_cast<double>(i * i % 17) / 7;
  rig.joint_covariance = root * root.transpose();
  for (int c = 0; c < 2; ++c) {
    rig.cameras[c].params_covariance = rig.joint_covariance->block<4, 4>(10 * c, 10 * c);
    rig.cameras[c].cam_from_world_covariance = rig.joint_covariance->block<6, 6>(10 * c + 4, 10 * c + 4);
  }
  return rig;
}

TEST(JointCovariance, SurvivesTheFileBitForBit) {
  const Rig rig = TwoCamerasWithCovariance();
  const Rig read = RigFromJsonText(RigToJsonText(rig), "file");
  ASSERT_TRUE(HasJointCovariance(read));
  for (Eigen::Index i = 0; i < 20; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) EXPECT_EQ((*read.joint_covariance)(i, j), (*rig.joint_covariance)(i, j));
  }
}

TEST(JointCovariance, OfOtherCamerasIsNotWritten) {
  Rig rig = TwoCamerasWithCovariance();
  rig.cameras[0].params_covariance = Eigen::MatrixXd::Identity(4, 4);
  EXPECT_FALSE(HasJointCovariance(rig));
  EXPECT_EQ(RigToJsonText(rig).find("joint_covariance"), std::string::npos);
}

TEST(JointCovariance, OfTheWrongSizeIsAFormatError) {
  std::string text = RigToJsonText(TwoCamerasWithCovariance());
  text.erase(text.rfind(",\n    ["), text.rfind("\n  ]") - text.rfind(",\n    ["));  // the last row
  EXPECT_THROW(RigFromJsonText(text, "file"), FormatError);
}

}  // namespace
}  // namespace mvstudio::geometry
