#include "stages/people/feet_floor.h"

#include <cmath>

#include "core/random.h"
#include "core/units.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using Eigen::Vector3d;

const geometry::Rigid3 kWorldFromFloor{geometry::RotationExp(Vector3d(1.9, 0.3, -0.4)), Vector3d(0.5, 1.6, 3)};

/// A person of 1.75 m who walks along a path: the foot on the left or right of a step stands, the other is lifted.
class Walker {
 public:
  Walker(double noise_m, std::vector<std::string> feet) : noise_m_(noise_m), feet_(std::move(feet)) {}

  /// `steps` steps with the direction turning by `turn_rad` a step.
  dataset::Pose3d Walk(int steps, double turn_rad, double step_m = 0.6) {
    pose_.skeleton = "body25";
    Vector3d at(0, 0, 0);
    double heading = 0;
    for (int step = 0; step < steps; ++step) {
      const Vector3d ahead(std::cos(heading), std::sin(heading), 0), left(-ahead.y(), ahead.x(), 0);
      const double side = step % 2 == 0 ? 1 : -1;
      for (int frame = 0; frame < 12; ++frame) {
        const double lift = 0.15 * std::sin(M_PI * (frame + 0.5) / 12), swing = step_m * (frame / 6.0 - 1);
        AddLeg(at + 0.1 * side * left, ahead, side, 0);
        AddLeg(at - 0.1 * side * left + swing * ahead, ahead, -side, lift);
        ++frame_;
      }
      at += step_m * ahead, heading += turn_rad;
    }
    return pose_;
  }

 private:
  void Add(const std::string& joint, const Vector3d& x_in_floor) {
    const Vector3d noise(rng_.Normal(), rng_.Normal(), rng_.Normal());
    dataset::JointRow row;
    row.frame = frame_, row.joint = joint, row.status = Status::kOk;
    row.x_in_world = kWorldFromFloor * Vector3d(x_in_floor + noise_m_ * noise);
    pose_.rows.push_back(row);
  }
  void AddLeg(const Vector3d& at, const Vector3d& ahead, double side, double lift) {
    const std::string letter = side > 0 ? "L" : "R";
    const Vector3d up = Vector3d::UnitZ();
    Add(letter + "Hip", at + 0.927 * up);
    Add(letter + "Knee", at + (0.499 + lift / 2) * up);
    for (const std::string& foot : feet_) {
      const double height = foot == "Ankle" ? 0.06825 : foot == "Heel" ? 0.02 : 0.01;
      const double forward = foot == "Ankle" ? 0 : foot == "Heel" ? -0.05 : 0.15;
      Add(letter + foot, at + (height + lift) * up + forward * ahead);
    }
  }
  double noise_m_;
  std::vector<std::string> feet_;
  Rng rng_{3};
  int frame_ = 0;
  dataset::Pose3d pose_;
};

/// Angle between the found and the true normal, radians, and the height of the found floor above the true one.
std::pair<double, double> Errors(const FeetFloor& floor) {
  const geometry::Rigid3 found_from_floor = floor.floor_from_world * kWorldFromFloor;
  const Vector3d up = found_from_floor.rotation * Vector3d::UnitZ();
  return {std::atan2(up.head<2>().norm(), up.z()), -found_from_floor.translation.z()};
}

TEST(FloorUnderFeet, WalkingInACircleGivesTheFloor) {
  const FeetFloor floor = FloorUnderFeet(Walker(5e-3, {"Ankle", "Heel", "BigToe"}).Walk(24, 0.4));
  ASSERT_EQ(floor.status, Status::kOk) << floor.message;
  const auto [tilt, height] = Errors(floor);
  EXPECT_LT(tilt, 3 * floor.tilt_sigma_rad);
  EXPECT_LT(floor.tilt_sigma_rad, DegToRad(1.0));
  EXPECT_NEAR(floor.joint_height_m.at("Ankle"), 0.058, 0.004) << "above the big toes";
  EXPECT_LT(floor.rms_m, 5e-3);
}

TEST(FloorUnderFeet, AnklesAloneLieByTheStatureAboveIt) {
  const FeetFloor floor = FloorUnderFeet(Walker(0, {"Ankle"}).Walk(24, 0.4));
  ASSERT_EQ(floor.status, Status::kOk) << floor.message;
  const auto [tilt, height] = Errors(floor);
  EXPECT_LT(tilt, 1e-6);
  EXPECT_NEAR(height, 0, 2e-3) << floor.level;
  EXPECT_THAT(floor.level, HasSubstr("below the ankles"));
}

TEST(FloorUnderFeet, TheOldOriginAndXAxisStayAboveTheirPlaces) {
  const FeetFloor floor = FloorUnderFeet(Walker(0, {"Ankle"}).Walk(24, 0.4));
  EXPECT_LT(floor.floor_from_world.translation.head<2>().norm(), 1e-12);
  EXPECT_LT(std::abs((floor.floor_from_world.rotation * Vector3d::UnitX()).y()), 1e-12);
}

TEST(FloorUnderFeet, OneLineOrOneSpotIsRefused) {
  const FeetFloor line = FloorUnderFeet(Walker(8e-3, {"Ankle"}).Walk(6, 0));
  EXPECT_EQ(line.status, Status::kDegenerate) << RadToDeg(line.tilt_sigma_rad);
  EXPECT_THAT(line.message, HasSubstr("in more than one direction"));
  const FeetFloor spot = FloorUnderFeet(Walker(5e-3, {"Ankle"}).Walk(20, 0, 0));
  EXPECT_EQ(spot.status, Status::kDegenerate)
      << RadToDeg(spot.tilt_sigma_rad) << " " << spot.num_used << " of " << spot.num_places;
}

TEST(FloorUnderFeet, WithoutFeetThereIsNoFloor) {
  EXPECT_EQ(FloorUnderFeet({}).status, Status::kTooFewViews);
  const FeetFloor none = FloorUnderFeet(Walker(0, {}).Walk(10, 0.4));
  EXPECT_EQ(none.status, Status::kTooFewViews);
  EXPECT_FALSE(none.message.empty());
}

}  // namespace
}  // namespace mvstudio::stages
