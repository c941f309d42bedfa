#include "dataset/markers/joint_angles.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "core/random.h"
#include "core/units.h"
#include "tests/support/test.h"

namespace mvstudio::markers {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d R(double deg, const Vector3d& axis) { return Eigen::AngleAxisd(DegToRad(deg), axis).toRotationMatrix(); }
Matrix3d Rz(double deg) { return R(deg, Vector3d::UnitZ()); }
Matrix3d Rx(double deg) { return R(deg, Vector3d::UnitX()); }
Matrix3d Ry(double deg) { return R(deg, Vector3d::UnitY()); }

/// A person put together from angles: x forward, y up, z to the right, as ISB has it.
struct Person {
  double heading = 0, tilt = 0;                                 ///< of the pelvis, with the trunk
  double hip_flexion = 0, hip_adduction = 0, hip_rotation = 0;  ///< of both sides
  double knee = 0, ankle = 0;
  double plane = 0, elevation = 0, shoulder_rotation = 0, elbow = 0;

  std::map<std::string, Vector3d> Joints() const {
    std::map<std::string, Vector3d> j;
    const Matrix3d pelvis = Ry(heading) * Rz(tilt);
    const Vector3d hips(0.2, 0.95, -0.4);
    const auto side = [&](const std::string& s, double sign) {
      // Of the left side as the mirror image of a right one.
      const auto at = [&](const Vector3d& own) { return Vector3d(hips + pelvis * Vector3d(own.x(), own.y(), sign * own.z())); };
      const Vector3d hip(0, 0, 0.1), shoulder(0, 0.5, 0.18);
      const Matrix3d thigh = Rz(hip_flexion) * Rx(hip_adduction) * Ry(hip_rotation), shank = thigh * Rz(-knee);
      const Vector3d knee_at = hip + thigh * Vector3d(0, -0.42, 0), ankle_at = knee_at + shank * Vector3d(0, -0.4, 0);
      const Matrix3d foot = shank * Rz(ankle);
      j[s + "Hip"] = at(hip), j[s + "Knee"] = at(knee_at), j[s + "Ankle"] = at(ankle_at);
      j[s + "Heel"] = at(ankle_at + foot * Vector3d(-0.05, -0.06, 0)),
            j[s + "BigToe"] = at(ankle_at + foot * Vector3d(0.15, -0.06, 0));
      const Matrix3d arm = Ry(plane) * Rx(-elevation) * Ry(shoulder_rotation), fore = arm * Rz(elbow);
      const Vector3d elbow_at = shoulder + arm * Vector3d(0, -0.3, 0);
      j[s + "Shoulder"] = at(shoulder), j[s + "Elbow"] = at(elbow_at),
            j[s + "Wrist"] = at(elbow_at + fore * Vector3d(0, -0.25, 0));
    };
    side("R", 1), side("L", -1);
    return j;
  }
};

MarkerTake TakeOf(const std::vector<Person>& frames) {
  MarkerTake take;
  take.rate_hz = 50, take.first_frame = 7;
  for (const auto& [name, x] : frames[0].Joints()) take.names.push_back(name);
  for (const Person& person : frames) {
    for (const auto& [name, x] : person.Joints()) take.x_in_world.emplace_back(x.z(), x.x(), x.y());  // y up to z up
  }
  take.source.assign(take.x_in_world.size(), Source::kMeasured);
  take.sigma_m.assign(take.x_in_world.size(), 0);
  return take;
}

std::optional<Matrix3d> None(int, const std::string&) { return std::nullopt; }

size_t Place(const std::string& name) {
  const auto& all = AngleDefinitions();
  for (size_t a = 0; a < all.size(); ++a) {
    if (all[a].name == name) return a;
  }
  ADD_FAILURE() << name;
  return 0;
}
const Angle& At(const AngleTake& take, int frame, const std::string& name) { return take.At(frame, Place(name)); }

TEST(JointAngles, AreThoseThatThePersonWasMadeOf) {
  Rng rng(5);
  for (int trial = 0; trial < 40; ++trial) {
    Person p;
    p.heading = 170 * (2 * rng.Uniform() - 1), p.tilt = 30 * (2 * rng.Uniform() - 1);
    p.hip_flexion = 100 * rng.Uniform() - 20, p.hip_adduction = 60 * rng.Uniform() - 30,
    p.hip_rotation = 60 * rng.Uniform() - 30;
    p.knee = 20 + 100 * rng.Uniform(), p.ankle = 40 * rng.Uniform() - 20;
    p.plane = 170 * (2 * rng.Uniform() - 1), p.elevation = 20 + 140 * rng.Uniform(),
    p.shoulder_rotation = 120 * rng.Uniform() - 60;
    p.elbow = 20 + 120 * rng.Uniform();
    const AngleTake angles = AnglesOf(TakeOf({p}), true, None);
    EXPECT_NEAR(At(angles, 0, "pelvis_heading").deg, p.heading, 1e-9);
    EXPECT_NEAR(At(angles, 0, "trunk_flexion").deg, -p.tilt, 1e-9);
    for (const std::string side : {"_r", "_l"}) {
      const auto is = [&](const char* name, double deg) {
        EXPECT_EQ(At(angles, 0, name + side).status, AngleStatus::kOk) << name;
        EXPECT_NEAR(std::remainder(At(angles, 0, name + side).deg - deg, 360), 0, 1e-8) << name << side;
      };
      is("hip_flexion", p.hip_flexion), is("hip_adduction", p.hip_adduction), is("hip_rotation", p.hip_rotation);
      is("knee_flexion", p.knee), is("ankle_dorsiflexion", p.ankle);
      is("shoulder_plane", p.plane), is("shoulder_elevation", p.elevation), is("shoulder_rotation", p.shoulder_rotation);
      is("elbow_flexion", p.elbow);
    }
  }
}

TEST(JointAngles, OpenSimsPelvisTurnsTheSameWay) {
  Person p;
  p.heading = 25, p.tilt = -12;
  const AngleTake angles = AnglesOf(TakeOf({p}), true, None);
  const double tilt = At(angles, 0, "pelvis_trunk_tilt").deg, list = At(angles, 0, "pelvis_trunk_list").deg,
               rotation = At(angles, 0, "pelvis_trunk_rotation").deg;
  EXPECT_LT((Rz(tilt) * Rx(list) * Ry(rotation) - Ry(25) * Rz(-12)).norm(), 1e-9);
}

TEST(JointAngles, WhatAStraightLimbDoesNotTellIsMissingWithItsReason) {
  Person p;
  p.knee = 3, p.elbow = 2, p.elevation = 60, p.hip_flexion = 10;
  const AngleTake angles = AnglesOf(TakeOf({p}), true, None);
  for (const char* name : {"hip_rotation_r", "shoulder_rotation_l", "arm_rot_r"}) {
    EXPECT_EQ(At(angles, 0, name).status, AngleStatus::kStraightLimb) << name;
    EXPECT_TRUE(std::isnan(At(angles, 0, name).deg));
  }
  EXPECT_NEAR(At(angles, 0, "knee_flexion_r").deg, 3, 1e-9);
  p.knee = -6;  // overstretched
  EXPECT_NEAR(At(AnglesOf(TakeOf({p}), true, None), 0, "knee_flexion_l").deg, -6, 1e-9);
  p.elevation = 4;
  EXPECT_EQ(At(AnglesOf(TakeOf({p}), true, None), 0, "shoulder_plane_r").status, AngleStatus::kGimbal);
  EXPECT_EQ(At(AnglesOf(TakeOf({p}), false, None), 0, "pelvis_heading").status, AngleStatus::kNoUp);
  MarkerTake without = TakeOf({p});
  without.source[without.Index(0, static_cast<int>(std::find(without.names.begin(), without.names.end(), "LHeel") -
                                                   without.names.begin()))] = Source::kMissing;
  const AngleTake feet = AnglesOf(without, true, None);
  EXPECT_EQ(At(feet, 0, "ankle_dorsiflexion_l").status, AngleStatus::kMissingJoint);
  EXPECT_EQ(At(feet, 0, "ankle_dorsiflexion_r").status, AngleStatus::kOk);
}

TEST(JointAngles, DoNotJump) {
  std::vector<Person> turn(200);
  for (size_t f = 0; f < turn.size(); ++f) {
    Person& p = turn[f];
    p.heading = 5.0 * static_cast<double>(f), p.elbow = 40;                     // almost three turns
    p.elevation = 30 + 0.6 * static_cast<double>(f), p.shoulder_rotation = 10;  // arms over the head, sideways
  }
  const AngleTake angles = AnglesOf(TakeOf(turn), true, None);
  EXPECT_NEAR(At(angles, 199, "pelvis_heading").deg, 995, 1e-6);
  for (const char* name : {"pelvis_heading", "arm_add_r", "arm_flex_l", "arm_rot_l", "shoulder_elevation_r"}) {
    double last = std::nan("");
    for (int f = 0; f < 200; ++f) {
      const Angle& angle = At(angles, f, name);
      if (angle.status != AngleStatus::kOk) continue;
      if (std::isfinite(last)) {
        EXPECT_LT(std::abs(angle.deg - last), 45) << name << " frame " << f;
      }
      last = angle.deg;
    }
  }
}

TEST(JointAngles, DeviationsAreThoseOfManyDraws) {
  Person p;
  p.hip_flexion = 35, p.hip_adduction = 8, p.hip_rotation = 5, p.knee = 50, p.ankle = 5;
  p.plane = 30, p.elevation = 60, p.shoulder_rotation = 20, p.elbow = 70;
  const MarkerTake clean = TakeOf({p});
  Matrix3d covariance;
  covariance << 16e-6, 3e-6, 0, 3e-6, 9e-6, -2e-6, 0, -2e-6, 36e-6;
  const AngleTake told = AnglesOf(clean, true, [&](int, const std::string&) { return std::optional<Matrix3d>(covariance); });
  const Matrix3d root = covariance.llt().matrixL();
  constexpr int kDraws = 3000;
  const std::vector<std::string> names = {"pelvis_heading",       "hip_flexion_r",        "hip_rotation_r",
                                          "knee_flexion_l",       "ankle_dorsiflexion_r", "shoulder_plane_l",
                                          "shoulder_elevation_r", "elbow_flexion_r"};
  std::map<std::string, double> squares;
  Rng rng(11);
  for (int draw = 0; draw < kDraws; ++draw) {
    MarkerTake noisy = clean;
    for (Vector3d& x : noisy.x_in_world) x += root * Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    const AngleTake angles = AnglesOf(noisy, true, None);
    for (const std::string& name : names) squares[name] += std::pow(At(angles, 0, name).deg - At(told, 0, name).deg, 2);
  }
  for (const std::string& name : names) {
    const double drawn = std::sqrt(squares[name] / kDraws);
    EXPECT_NEAR(At(told, 0, name).sigma_deg / drawn, 1, 0.08) << name;
  }
  EXPECT_TRUE(std::isnan(At(AnglesOf(clean, true, None), 0, "knee_flexion_r").sigma_deg)) << "unknown, not zero";
}

TEST(JointAngles, FilesHoldWhatThereIs) {
  Person p;
  p.knee = 40, p.hip_flexion = 20, p.elbow = 30, p.elevation = 50;
  const AngleTake angles = AnglesOf(TakeOf({p, p}), true, None);
  const std::string mot = MotText(angles, "person0");
  EXPECT_THAT(mot, HasSubstr("inDegrees=yes\nendheader\ntime\t"));
  EXPECT_THAT(mot, HasSubstr("nRows=2\n"));
  EXPECT_THAT(mot, HasSubstr("\tknee_angle_r\t"));
  EXPECT_THAT(mot, Not(HasSubstr("neck")));
  EXPECT_THAT(AnglesCsvText(angles), HasSubstr("\n8,0.02,knee_flexion_r,40,,Ok\n"));
}

}  // namespace
}  // namespace mvstudio::markers
