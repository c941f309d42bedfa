#include "geometry/rig/plausible.h"

#include <cmath>

#include "core/units.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

/// Four cameras on a ring of 3 m with an ordinary lens.
Rig Ordinary() {
  Rig rig;
  for (int i = 0; i < 4; ++i) {
    RigCamera camera;
    camera.camera = MakePinhole("cam_" + std::to_string(i), 1920, 1080, 1400);
    camera.camera.model = LensModel::kBrown5;
    const Eigen::Vector4d pinhole = camera.camera.params;
    camera.camera.params.resize(9);
    camera.camera.params << pinhole, -0.2, 0.15, 1e-3, -5e-4, 0.01;
    camera.cam_from_world.rotation = RotationExp({0, i * kPi / 2, 0});
    camera.cam_from_world.translation = {0, 0, 3};
    rig.cameras.push_back(camera);
  }
  return rig;
}

std::vector<std::string> CodesOf(const Rig& rig) {
  std::vector<std::string> codes;
  for (const Notice& conflict : ConflictsIn(rig)) codes.push_back(conflict.code);
  return codes;
}

TEST(Plausible, NothingIsSaidOfOrdinaryRigs) {
  EXPECT_THAT(CodesOf(Ordinary()), IsEmpty());
  EXPECT_THAT(CodesOf({}), IsEmpty());
  Rig far = Ordinary();  // map coordinates
  for (RigCamera& camera : far.cameras)
    camera.cam_from_world.translation += camera.cam_from_world.rotation * Eigen::Vector3d(4e5, 5e6, 0);
  EXPECT_THAT(CodesOf(far), IsEmpty());
}

/// The camera matrix of images of half, or twice, the size.
TEST(Plausible, MatricesOfScaledImages) {
  for (const double scale : {0.25, 0.5, 1.5, 2.0}) {
    Rig rig = Ordinary();
    for (RigCamera& camera : rig.cameras) camera.camera.params.head<4>() *= scale;
    const std::vector<Notice> conflicts = ConflictsIn(rig);
    ASSERT_FALSE(conflicts.empty()) << scale;
    EXPECT_TRUE(std::any_of(conflicts.begin(), conflicts.end(), [](const Notice& n) { return n.code == "CAL-SIZE"; })) << scale;
  }
  Rig halved = Ordinary();
  for (RigCamera& camera : halved.cameras) camera.camera.params.head<4>() *= 0.5;
  const std::vector<Notice> said = ConflictsIn(halved);
  EXPECT_TRUE(std::any_of(said.begin(), said.end(), [](const Notice& n) {
    return n.code == "CAL-SIZE" && n.text.find("or the images are cut out (ROI)") != std::string::npos;
  }));
  halved.cameras.resize(1);
  EXPECT_THAT(CodesOf(halved), Not(::testing::Contains("CAL-SIZE"))) << "one camera's image may be cut out";
  Rig one = Ordinary();
  one.cameras[0].camera.params.segment<2>(2) *= 0.5;
  EXPECT_THAT(CodesOf(one), Not(::testing::Contains("CAL-SIZE"))) << "one camera's image may be cut out";
}

TEST(Plausible, WidthAndHeightExchanged) {
  for (const auto& [width, height] : {std::pair(1920, 1080), std::pair(640, 480), std::pair(1280, 1024)}) {
    Rig rig;
    rig.cameras.emplace_back().camera = MakePinhole("a", width, height, 1.2 * width);
    EXPECT_THAT(CodesOf(rig), IsEmpty()) << width;
    Camera& camera = rig.cameras[0].camera;
    camera.params[2] += 0.01 * width, camera.params[3] -= 0.01 * height;
    std::swap(camera.width_px, camera.height_px);
    EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-SIDES")) << width;
  }
  Rig cropped;  // the middle of the lens is that of neither shape
  cropped.cameras.emplace_back().camera = MakePinhole("a", 1080, 1080, 1400);
  cropped.cameras[0].camera.params[2] = 959.5;
  EXPECT_THAT(CodesOf(cropped), IsEmpty());
}

TEST(Plausible, DecentringBeyondAnyLens) {
  Rig rig = Ordinary();
  rig.cameras[1].camera.params.tail<5>() << -0.05, 0.02, 6.459, 0.01, 0.3;
  const std::vector<Notice> conflicts = ConflictsIn(rig);
  ASSERT_FALSE(conflicts.empty());
  EXPECT_EQ(conflicts[0].code, "CAL-DECENTRING");
  EXPECT_THAT(conflicts[0].text, HasSubstr("camera cam_1: a decentring (p1, p2) of 6.459"));
  rig = Ordinary();
  rig.cameras[1].camera.params[7] = -0.049;
  EXPECT_THAT(CodesOf(rig), Not(::testing::Contains("CAL-DECENTRING")));
}

TEST(Plausible, DecentringThatIsTheThirdRadialTerm) {
  Rig rig = Ordinary();
  for (RigCamera& camera : rig.cameras) camera.camera.params.tail<5>() << -0.2, 0.15, -0.08, 1e-3, -5e-4;  // k1 k2 k3 p1 p2
  const std::vector<Notice> conflicts = ConflictsIn(rig);
  ASSERT_FALSE(conflicts.empty());
  EXPECT_EQ(conflicts[0].code, "CAL-DECENTRING");
  EXPECT_THAT(conflicts[0].text, HasSubstr("in the order k1 k2 k3 p1 p2 the terms make sense"));
  EXPECT_THAT(conflicts[0].text, HasSubstr("cam_0, cam_1, cam_2 and 1 more"));
}

TEST(Plausible, SmallTermsInAnotherOrder) {
  Rig rig = Ordinary();
  for (RigCamera& camera : rig.cameras) camera.camera.params.tail<5>() << -0.2, 0.15, -0.02, 1e-3, -5e-4;
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-TERMORDER"));
  rig = Ordinary();  // one strongly decentred lens among four is a lens
  rig.cameras[2].camera.params[6] = -0.02, rig.cameras[2].camera.params[8] = 1e-4;
  EXPECT_THAT(CodesOf(rig), IsEmpty());
}

TEST(Plausible, LensesThatFoldInsideTheImage) {
  Rig rig = Ordinary();
  rig.cameras[0].camera.params.tail<5>() << -0.9, 0, 0, 0, 0;  // folds at r = 0.61, the corner lies at 0.79
  const std::vector<Notice> conflicts = ConflictsIn(rig);
  ASSERT_EQ(conflicts.size(), 1u);
  EXPECT_EQ(conflicts[0].code, "CAL-FOLD");
  EXPECT_THAT(conflicts[0].text, HasSubstr("camera cam_0: the lens folds inside the image"));
  EXPECT_EQ(ShareWithoutRay(Ordinary().cameras[0].camera), 0);
  EXPECT_GT(ShareWithoutRay(rig.cameras[0].camera), 0.2);
}

TEST(Plausible, ACircularFisheyeMayLeaveItsCornersDark) {
  Rig rig = Ordinary();
  Camera& fisheye = rig.cameras[0].camera;
  fisheye.model = LensModel::kKannalaBrandt4;
  fisheye.params.resize(8);
  fisheye.params << 300, 300, 959.5, 539.5, -0.05, 0, 0, 0;  // the circle ends at 1.9 rad
  EXPECT_THAT(CodesOf(rig), IsEmpty());
  EXPECT_GT(ShareWithoutRay(fisheye), 0);
  fisheye.params[4] = -0.6;  // 43 degrees
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-FOLD"));
}

TEST(Plausible, PrincipalPointFarOutside) {
  Rig rig = Ordinary();
  rig.cameras[3].camera.params[2] = -0.29 * 1920;  // a crop
  rig.cameras[3].camera.params.tail<5>().setZero();
  EXPECT_THAT(CodesOf(rig), IsEmpty());
  rig.cameras[3].camera.params[2] = -0.31 * 1920;
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-CENTRE"));
  rig.cameras[3].camera.params[2] = 900;
  rig.cameras[3].camera.params[3] = 1.31 * 1080;
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-CENTRE"));
}

TEST(Plausible, AbsurdFocalLengths) {
  for (const auto& [fx, fy] : {std::pair(8.0, 8.0), std::pair(1.2, 2.1), std::pair(1e5, 1e5), std::pair(641.0, 1060.0)}) {
    Rig rig = Ordinary();
    for (RigCamera& camera : rig.cameras) {
      camera.camera = MakePinhole(camera.camera.name, 1920, 1080, 1);
      camera.camera.params[0] = fx, camera.camera.params[1] = fy;
    }
    EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-FOCALSIZE")) << fx;
  }
  Rig tele = Ordinary();  // 2.1 degrees corner to corner
  for (RigCamera& camera : tele.cameras) camera.camera = MakePinhole(camera.camera.name, 1920, 1080, 60000);
  EXPECT_THAT(CodesOf(tele), IsEmpty());
}

TEST(Plausible, UnitsByTheDistancesOfTheCameras) {
  for (const double scale : {1000.0, 100.0, 39.37, 1e-3}) {
    Rig rig = Ordinary();
    for (RigCamera& camera : rig.cameras) camera.cam_from_world.translation *= scale;
    EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-DISTANCES")) << scale;
  }
  Rig millimetres = Ordinary();
  for (RigCamera& camera : millimetres.cameras) camera.cam_from_world.translation *= 1000;
  EXPECT_THAT(ConflictsIn(millimetres)[0].text, HasSubstr("6000 m apart; were the numbers millimetres it would be 6 m"));
  Rig stereo = Ordinary();  // a phone's two cameras
  stereo.cameras.resize(2);
  stereo.cameras[1].cam_from_world = stereo.cameras[0].cam_from_world;
  stereo.cameras[1].cam_from_world.translation.x() += 0.012;
  EXPECT_THAT(CodesOf(stereo), IsEmpty());
  stereo.cameras[1].cam_from_world = stereo.cameras[0].cam_from_world;  // lenses alone, without places
  EXPECT_THAT(CodesOf(stereo), IsEmpty());
}

TEST(Plausible, AllCamerasAtOnePlace) {
  Rig rig = Ordinary();
  for (RigCamera& camera : rig.cameras) camera.cam_from_world.translation.setZero();
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-DISTANCES")) << "at the world's origin";
  for (RigCamera& camera : rig.cameras)
    camera.cam_from_world.translation = camera.cam_from_world.rotation * Eigen::Vector3d(-1, 2, -3);
  EXPECT_THAT(CodesOf(rig), ElementsAre("CAL-DISTANCES"));
}

TEST(Plausible, MatricesThatAreNoRotation) {
  Eigen::Matrix3d r = RotationExp({0.3, -1, 0.2}).toRotationMatrix();
  EXPECT_EQ(WhyNotARotation(r), "");
  EXPECT_THAT(WhyNotARotation(1.01 * r), HasSubstr("is it scaled"));
  EXPECT_THAT(WhyNotARotation(r * Eigen::Vector3d(1, 1, -1).asDiagonal()), HasSubstr("a reflection"));
  r(0, 0) = std::nan("");
  EXPECT_THAT(WhyNotARotation(r), HasSubstr("not finite"));
}

TEST(Plausible, OrdersOfTermsArePermutations) {
  const Camera lens = Ordinary().cameras[0].camera;
  const std::vector<TermOrder> orders = OtherTermOrders(lens);
  ASSERT_EQ(orders[0].name, "k1 k2 k3 p1 p2");
  // The file's third number is k3; the fourth and fifth are p1, p2.
  EXPECT_EQ(orders[0].camera.params.tail<5>(), (Eigen::Matrix<double, 5, 1>() << -0.2, 0.15, -5e-4, 0.01, 1e-3).finished());
  for (const TermOrder& order : orders) EXPECT_NEAR(order.camera.params.sum(), lens.params.sum(), 1e-9) << order.name;
  EXPECT_THAT(OtherTermOrders(MakePinhole("a", 64, 48, 50)), IsEmpty());
}

}  // namespace
}  // namespace mvstudio::geometry
