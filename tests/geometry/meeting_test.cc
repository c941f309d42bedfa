#include "geometry/rig/meeting.h"

#include <cmath>
#include <iostream>
#include <random>

#include "core/units.h"
#include "geometry/rig/plausible.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

/// Cameras on a ring of 3 m, 1 m above the place that they look at, which lies off the origin.
Rig Ring(int count = 5) {
  Rig rig;
  const Eigen::Vector3d target(0.3, -0.2, 1);
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * kPi * i / count + 0.1;
    const Eigen::Vector3d centre = target + Eigen::Vector3d(3 * std::cos(angle), 3 * std::sin(angle), 1 + 0.2 * i);
    Eigen::Matrix3d rotation;
    const Eigen::Vector3d forward = (target - centre).normalized(),
                          right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    RigCamera camera;
    camera.camera = MakePinhole("c" + std::to_string(i), 1920, 1080, 1400);
    camera.cam_from_world.rotation = Eigen::Quaterniond(rotation);
    camera.cam_from_world.translation = -rotation * centre;
    rig.cameras.push_back(camera);
  }
  return rig;
}

bool Says(const Rig& rig, const std::string& code) {
  const std::vector<Notice> conflicts = ConflictsIn(rig);
  return std::any_of(conflicts.begin(), conflicts.end(), [&](const Notice& conflict) { return conflict.code == code; });
}

TEST(Meeting, IsWhereTheCamerasLook) {
  const AxesMeeting meeting = MeetingOfAxes(Ring());
  ASSERT_TRUE(meeting.sharp());
  EXPECT_LT((meeting.x_in_world - Eigen::Vector3d(0.3, -0.2, 1)).norm(), 1e-9);
  EXPECT_EQ(meeting.in_front, 5);
  EXPECT_EQ(MeetingOfAxes(WithAxesRotated(Ring())).in_front, 0);
  EXPECT_FALSE(MeetingOfAxes({}).determined);
}

TEST(Meeting, InvertedPosesAreRecognisedAndMended) {
  EXPECT_TRUE(ConflictsIn(Ring()).empty());
  const Rig inverted = WithPosesInverted(Ring());
  EXPECT_TRUE(Says(inverted, "CAL-INVERTED"));
  const Rig back = WithPosesInverted(inverted);
  for (size_t i = 0; i < back.cameras.size(); ++i)
    EXPECT_LT((back.cameras[i].CenterInWorld() - Ring().cameras[i].CenterInWorld()).norm(), 1e-12);
  // A studio that is the same from all sides stands at one place when it is inverted.
  Rig even = Ring(4);
  for (int i = 0; i < 4; ++i) {
    even.cameras[static_cast<size_t>(i)].cam_from_world.rotation = RotationExp({0, i * kPi / 2, 0});
    even.cameras[static_cast<size_t>(i)].cam_from_world.translation = {0, 0, 3};
  }
  EXPECT_FALSE(Says(even, "CAL-INVERTED"));
  const Rig at_one_place = WithPosesInverted(even);
  EXPECT_TRUE(Says(at_one_place, "CAL-INVERTED"));
  EXPECT_FALSE(Says(at_one_place, "CAL-DISTANCES"));
}

TEST(Meeting, TransposedRotationsAreRecognised) {
  const Rig transposed = WithRotationsTransposed(Ring());
  EXPECT_TRUE(Says(transposed, "CAL-TRANSPOSED"));
  EXPECT_FALSE(Says(transposed, "CAL-INVERTED"));
  EXPECT_TRUE(ConflictsIn(WithRotationsTransposed(transposed)).empty());
  EXPECT_FALSE(Says(WithPosesInverted(Ring()), "CAL-TRANSPOSED"));
}

/// Metres read as centimetres put a room into a box of a few centimetres.
TEST(Meeting, APlaceThatIsTooNearIsNamed) {
  Rig near = Ring();
  for (RigCamera& camera : near.cameras) camera.cam_from_world.translation *= 0.008;
  EXPECT_TRUE(Says(near, "CAL-DISTANCES"));
  for (RigCamera& camera : near.cameras) camera.cam_from_world.translation *= 2;  // 53 mm: a rig around a fly
  EXPECT_TRUE(ConflictsIn(near).empty());
  const std::vector<Notice> in_centimetres = ConflictsIn(near, true);
  ASSERT_EQ(in_centimetres.size(), 1u);
  EXPECT_EQ(in_centimetres[0].code, "CAL-DISTANCES");
  for (RigCamera& camera : near.cameras) camera.cam_from_world.translation *= 5;  // a mouse
  EXPECT_TRUE(ConflictsIn(near, true).empty());
}

/// Cameras around a field of 24 m, 30 m from its middle, that look at players: aimed at points far apart, they nearly meet
/// transposed now and then.
TEST(Meeting, CamerasThatFollowAGameAreNotCalledTransposed) {
  constexpr int kRigs = 2000;
  std::mt19937 random(11);
  const auto within = [&](double limit) { return std::uniform_real_distribution<double>(-limit, limit)(random); };
  int raised = 0;
  for (int k = 0; k < kRigs; ++k) {
    const int count = 3 + k % 6;
    const Eigen::Vector3d middle(within(40), within(40), 0);
    const double turn = within(kPi);
    Rig rig;
    for (int i = 0; i < count; ++i) {
      const double angle = turn + 2 * kPi * (i + within(0.3)) / count;
      const Eigen::Vector3d centre = middle + Eigen::Vector3d(30 * std::cos(angle), 30 * std::sin(angle), 5 + within(3)),
                            target = middle + Eigen::Vector3d(within(12), within(12), 1);
      const Eigen::Vector3d forward = (target - centre).normalized(),
                            right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
      Eigen::Matrix3d rotation;
      rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
      RigCamera& camera = rig.cameras.emplace_back();
      camera.camera = MakePinhole("c" + std::to_string(i), 1920, 1080, 1400);
      camera.cam_from_world.rotation = Eigen::Quaterniond(rotation);
      camera.cam_from_world.translation = -rotation * centre;
    }
    raised += Says(rig, "CAL-TRANSPOSED");
  }
  RecordProperty("raised", raised);
  std::cout << "CAL-TRANSPOSED of sound rigs: " << raised << " of " << kRigs << "\n";
  EXPECT_LE(raised, kRigs / 200);
  for (const int count : {5, 6, 7}) EXPECT_TRUE(Says(WithRotationsTransposed(Ring(count)), "CAL-TRANSPOSED")) << count;
}

TEST(Meeting, CamerasThatLookAwayAreNamed) {
  EXPECT_TRUE(Says(WithAxesRotated(Ring()), "CAL-LOOKAWAY"));
  Rig one_place = Ring();
  for (RigCamera& camera : one_place.cameras)
    camera.cam_from_world.translation = camera.cam_from_world.rotation * Eigen::Vector3d(1, 2, 3);
  EXPECT_TRUE(Says(one_place, "CAL-DISTANCES"));
}

TEST(Meeting, TheFilesWorldCountsForTheInversion) {
  const Eigen::Matrix3d ours_from_file = RotationExp({kPi / 2, 0, 0}).toRotationMatrix();
  Rig file = Ring();  // in the file's world
  const auto into_ours = [&](Rig rig) {
    Rigid3 turn;
    turn.rotation = Eigen::Quaterniond(ours_from_file);
    for (RigCamera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * Inverse(turn);
    return rig;
  };
  Rig wrong = file;
  for (RigCamera& camera : wrong.cameras) camera.cam_from_world = Inverse(camera.cam_from_world);
  const Rig mended = WithPosesInverted(into_ours(wrong), ours_from_file), right = into_ours(file);
  for (size_t i = 0; i < right.cameras.size(); ++i) {
    EXPECT_LT((mended.cameras[i].CenterInWorld() - right.cameras[i].CenterInWorld()).norm(), 1e-12);
    EXPECT_LT(RotationAngle(mended.cameras[i].cam_from_world.rotation, right.cameras[i].cam_from_world.rotation), 1e-7);
  }
}

/// Left-handed, x right, y up, z forward, as Unity has world and cameras: the pixel of a point by its own numbers.
TEST(Meeting, MirroredRigsSeeTheSamePixels) {
  Rig rig = Ring(2);
  const Eigen::Vector3d point(0.5, 0.4, 0.9);
  const Rig mirrored = WithAxesMirrored(rig);
  for (size_t i = 0; i < 2; ++i) {
    const Eigen::Vector3d in_left_handed_cam = rig.cameras[i].cam_from_world * point;
    const Camera& lens = rig.cameras[i].camera;
    const Eigen::Vector2d px(lens.cx() + lens.fx() * in_left_handed_cam.x() / in_left_handed_cam.z(),
                             lens.cy() - lens.fy() * in_left_handed_cam.y() / in_left_handed_cam.z());
    const Eigen::Vector3d same_point(point.x(), -point.y(), point.z());
    const Projection seen = Projector(lens).Project(mirrored.cameras[i].cam_from_world * same_point);
    EXPECT_LT((seen.px - px).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace mvstudio::geometry
