#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "avatar/body/role_bones.h"
#include "core/error.h"
#include "core/random.h"
#include "synth/cloth/cloth_subject.h"
#include "synth/cloth/nearest_vertex.h"
#include "synth/motion.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

constexpr int kSteps = 8;
constexpr double kStepS = 0.001;

const body::BodyTemplate& Mannequin() {
  static const body::BodyTemplate body = body::MakeMannequin();
  return body;
}

body::BodyPose Rest(const geometry::Rigid3& world_from_body = {}) {
  return body::PoseFromAngles(Mannequin(), world_from_body,
                              std::vector<Eigen::Quaterniond>(Mannequin().bone_names.size(), Eigen::Quaterniond::Identity()));
}

/// A turn on the spot that begins at once, `seconds` long.
Status Spin(ClothSubject* subject, double seconds) {
  Status status = subject->Reset(TurnPose(Mannequin(), 0, 2, 1));
  for (int i = 1; i <= seconds / (kSteps * kStepS) && status == Status::kOk; ++i)
    status = subject->Advance(TurnPose(Mannequin(), i * kSteps * kStepS, 2, 1), kSteps, kStepS);
  return status;
}

double Distance(const Eigen::Vector3d& x, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (x - a - t * (b - a)).norm();
}

/// Least distance of the cloth from the axes of the thighs, metres.
double DistanceFromThighs(const ClothSubject& subject, const body::BodyPose& pose) {
  double least = 1e9;
  for (const auto& leg : body::FindRoleBones(Mannequin()).legs) {
    const Eigen::Vector3d a = pose.bone_transforms[leg[0]] * Eigen::Vector3d(Mannequin().bone_heads.col(leg[0]));
    const Eigen::Vector3d b = pose.bone_transforms[leg[0]] * Eigen::Vector3d(Mannequin().bone_tails.col(leg[0]));
    for (Eigen::Index i = 0; i < subject.sim().positions().cols(); ++i)
      least = std::min(least, Distance(subject.sim().positions().col(i), a, b));
  }
  return least;
}

TEST(DressedBody, IsOneSurfaceWithSoundSkin) {
  const DressedBody dressed = Dress(Mannequin(), {});
  const body::BodyTemplate& s = dressed.surface;
  ASSERT_EQ(dressed.garments.size(), 2u);
  EXPECT_EQ(dressed.garments.back().first + dressed.garments.back().vertices(), s.vertices.cols());
  EXPECT_EQ(static_cast<Eigen::Index>(s.face_part.size()), s.faces.cols());
  EXPECT_EQ(s.face_uv.cols(), 3 * s.faces.cols());
  EXPECT_EQ(s.vertices.leftCols(dressed.body_vertices), Mannequin().vertices);
  EXPECT_EQ(s.faces.leftCols(dressed.body_faces), Mannequin().faces);
  EXPECT_GE(s.face_uv.minCoeff(), 0);
  EXPECT_LE(s.face_uv.maxCoeff(), 1);
  for (Eigen::Index i = 0; i < s.vertices.cols(); ++i) ASSERT_NEAR(s.skin_weights.col(i).sum(), 1, 1e-5) << "vertex " << i;
  for (Eigen::Index f = dressed.body_faces; f < s.faces.cols(); ++f) {  // cloth faces away from the body's axis
    const Eigen::Vector3f a = s.vertices.col(s.faces(0, f)), b = s.vertices.col(s.faces(1, f)),
                          c = s.vertices.col(s.faces(2, f));
    ASSERT_GT((b - a).cross(c - a).head<2>().dot((a + b + c).head<2>()), 0) << "face " << f;
  }
}

TEST(DressedBody, GarmentsLieOutsideTheBodyAndEachOther) {
  const DressedBody dressed = Dress(Mannequin(), {});
  const Garment &skirt = dressed.garments[0], &shirt = dressed.garments[1];
  for (int c = 0; c < skirt.columns; ++c) {
    for (int r = 0; r < shirt.rows; ++r) {
      const Eigen::Vector3f outer = dressed.surface.vertices.col(shirt.At(r, c));
      for (int q = 0; q < skirt.rows; ++q) {
        const Eigen::Vector3f inner = dressed.surface.vertices.col(skirt.At(q, c));
        if (std::abs(outer.z() - inner.z()) < 0.01f) {
          EXPECT_GT(outer.head<2>().norm(), inner.head<2>().norm());
        }
      }
    }
  }
  int covered = 0;
  for (const uint8_t is : dressed.covered) covered += is;
  EXPECT_GT(covered, 1000);
  EXPECT_LT(covered, dressed.body_vertices / 2);
}

TEST(DressedBody, ABodyWithoutThighsIsRefused) {
  body::BodyTemplate body = Mannequin();
  body.coco19.row(2).array() += 5;  // joints far above the surface
  EXPECT_THROW(Dress(body, {}), UsageError);
}

TEST(NearestVertex, AgreesWithLookingAtAll) {
  const Eigen::Matrix3Xd points = Mannequin().vertices.cast<double>();
  const NearestVertex nearest(points, 0.04);
  Rng rng(3);
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d x(rng.Uniform(-0.8, 0.8), rng.Uniform(-0.3, 0.3), rng.Uniform(-0.1, 1.9));
    Eigen::Index expected = 0;
    const double distance = std::sqrt((points.colwise() - x).colwise().squaredNorm().minCoeff(&expected));
    EXPECT_EQ(nearest.Find(x), distance < 0.04 ? expected : -1);
    found += distance < 0.04;
  }
  EXPECT_GT(found, 100);
  EXPECT_EQ(nearest.Find({1e30, 0, 0}), -1);
  EXPECT_EQ(nearest.Find({std::nan(""), 0, 0}), -1);
}

TEST(Cloth, HangsAtRest) {
  ClothSubject subject(Mannequin(), 1);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  const auto wait = [&](double seconds) {
    for (int i = 0; i < seconds / (kSteps * kStepS); ++i) ASSERT_EQ(subject.Advance(Rest(), kSteps, kStepS), Status::kOk);
  };
  wait(0.4);
  const ClothSim::Energy early = subject.sim().energy();
  wait(1.6);
  const ClothSim::Energy later = subject.sim().energy();
  wait(2);
  const ClothSim::Energy end = subject.sim().energy();
  EXPECT_LT(later.total_j(), early.total_j());
  EXPECT_LT(end.total_j(), later.total_j() + 1e-3);
  EXPECT_LT(end.kinetic_j, 1e-4);
  EXPECT_LT(end.kinetic_j, 0.02 * early.kinetic_j);
  EXPECT_LT(subject.sim().max_speed(), 0.1);
  EXPECT_LT(subject.sim().stretch().rms, 0.01);
  EXPECT_LT(subject.sim().stretch().max, 0.05);
  EXPECT_GT(DistanceFromThighs(subject, Rest()), 0.06);
  const float hem = subject.vertices().row(2).rightCols(subject.sim().positions().cols()).minCoeff();
  EXPECT_LT(hem, 0.62f);
  EXPECT_GT(hem, 0.45f);
}

TEST(Cloth, KeepsItsLengthsAndStaysOutsideTheThighsInMotion) {
  ClothSubject subject(Mannequin(), 2);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  double moved = 0;
  for (int i = 1; i <= 150; ++i) {
    const double share = std::min(1.0, i / 60.0), t = 0.008 * i;
    std::vector<Eigen::Quaterniond> turns(Mannequin().bone_names.size(), Eigen::Quaterniond::Identity());
    const body::RoleBones bones = body::FindRoleBones(Mannequin());
    for (int side = 0; side < 2; ++side)
      turns[bones.legs[side][0]] = Eigen::AngleAxisd((side ? 0.6 : -0.6) * share * std::sin(6 * t), Eigen::Vector3d::UnitX());
    const body::BodyPose pose = body::PoseFromAngles(Mannequin(), {}, turns);
    ASSERT_EQ(subject.Advance(pose, kSteps, kStepS), Status::kOk);
    EXPECT_LT(subject.sim().stretch().rms, 0.02);
    EXPECT_LT(subject.sim().stretch().max, 0.25);
    EXPECT_GT(DistanceFromThighs(subject, pose), 0.055);
    moved = std::max<double>(moved, (subject.vertices() - subject.Skinned(pose)).colwise().norm().maxCoeff());
  }
  EXPECT_GT(moved, 0.05);
}

TEST(Cloth, FallsNeitherFasterNorSlowerWhenTheWorldTurnsAboutTheVertical) {
  ClothSubject one(Mannequin(), 1), two(Mannequin(), 1);
  const geometry::Rigid3 away{geometry::RotationExp({0, 0, 1.1}), {5, -3, 0.5}};
  ASSERT_EQ(one.Reset(Rest()), Status::kOk);
  ASSERT_EQ(two.Reset(Rest(away)), Status::kOk);
  for (int i = 0; i < 10; ++i) {
    ASSERT_EQ(one.Advance(Rest(), kSteps, kStepS), Status::kOk);
    ASSERT_EQ(two.Advance(Rest(away), kSteps, kStepS), Status::kOk);
  }
  double worst = 0;
  for (Eigen::Index i = 0; i < one.vertices().cols(); ++i) {
    const Eigen::Vector3d moved = away * one.vertices().col(i).cast<double>();
    worst = std::max(worst, (moved - two.vertices().col(i).cast<double>()).norm());
  }
  EXPECT_LT(worst, 2e-4);
}

TEST(Cloth, SkinningBeginsFromHowItHangs) {
  ClothSubject subject(Mannequin(), 1);
  const Eigen::Matrix3Xf cut = subject.dressed().surface.vertices;
  ASSERT_EQ(subject.Settle(), Status::kOk);
  const Eigen::Matrix3Xf hung = subject.dressed().surface.vertices;
  EXPECT_EQ(hung.leftCols(subject.dressed().body_vertices), cut.leftCols(subject.dressed().body_vertices));
  EXPECT_GT((hung - cut).colwise().norm().maxCoeff(), 0.05f);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  for (int i = 0; i < 50; ++i) ASSERT_EQ(subject.Advance(Rest(), kSteps, kStepS), Status::kOk);
  const Eigen::VectorXf moved = (subject.vertices() - subject.Skinned(Rest())).colwise().norm();
  EXPECT_LT(moved.maxCoeff(), 0.03f);
  EXPECT_LT(std::sqrt(moved.squaredNorm() / static_cast<float>(moved.size())), 0.004f);
}

TEST(Cloth, IsTheSameBitForBitAndOtherSeedsDiffer) {
  ClothSubject one(Mannequin(), 4), two(Mannequin(), 4), other(Mannequin(), 5);
  ASSERT_EQ(Spin(&one, 0.2), Status::kOk);
  ASSERT_EQ(Spin(&two, 0.2), Status::kOk);
  ASSERT_EQ(Spin(&other, 0.2), Status::kOk);
  EXPECT_EQ(one.vertices(), two.vertices());
  ASSERT_EQ(Spin(&one, 0.2), Status::kOk);  // Reset leaves nothing of the run before
  EXPECT_EQ(one.vertices(), two.vertices());
  EXPECT_TRUE(one.vertices().cols() != other.vertices().cols() || one.vertices() != other.vertices());
}

TEST(Cloth, ABodyThatIsNotFiniteMovesNothing) {
  ClothSubject subject(Mannequin(), 1);
  body::BodyPose broken = Rest();
  broken.bone_transforms[0].translation[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(subject.Reset(broken), Status::kNonFiniteInput);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  const Eigen::Matrix3Xd before = subject.sim().positions();
  EXPECT_EQ(subject.Advance(broken, kSteps, kStepS), Status::kNonFiniteInput);
  EXPECT_EQ(subject.sim().positions(), before);
  EXPECT_EQ(subject.Advance(Rest(), kSteps, kStepS), Status::kOk);
}

TEST(Cloth, ABodyThatJumpsTearsIt) {
  ClothSubject subject(Mannequin(), 1);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  EXPECT_EQ(subject.Advance(Rest({Eigen::Quaterniond::Identity(), {3, 0, 0}}), 1, kStepS), Status::kNotConverged);
  ASSERT_EQ(subject.Reset(Rest()), Status::kOk);
  EXPECT_EQ(subject.Advance(Rest(), kSteps, kStepS), Status::kOk);
}

}  // namespace
}  // namespace mvstudio::synth
