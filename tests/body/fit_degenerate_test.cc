#include "avatar/body/fit/fit_body.h"
#include "core/random.h"
#include "core/statistics.h"
#include "tests/body/fit_studio.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

Vector3d FaceNormal(const BodyTemplate& body, Eigen::Index f) {
  const Vector3d a = body.vertices.col(body.faces(0, f)).cast<double>();
  return (body.vertices.col(body.faces(1, f)).cast<double>() - a).cross(body.vertices.col(body.faces(2, f)).cast<double>() - a);
}

/// Faces of `body` that look the other way than those of `other`, in the same rest pose.
int RotatedBetween(const BodyTemplate& other, const BodyTemplate& body) {
  int rotated = 0;
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) rotated += FaceNormal(body, f).dot(FaceNormal(other, f)) < 0;
  return rotated;
}

/// The template with the person's lengths and joints: a fit that nothing is shown.
BodyTemplate Unfitted(const Studio& studio) {
  std::vector<FitStep> steps = studio.steps;
  for (FitStep& step : steps) step.views.clear();
  return FitBody(studio.rest, steps, {}, {}).person.body;
}

/// Over all silhouettes, in the poses that the fit saw.
double MeanIou(const Studio& studio, const BodyFit& fit) {
  std::vector<double> ious;
  for (const auto& [frame, pose] : fit.person.seen) {
    const Eigen::Matrix3Xf vertices = SkinVertices(fit.person.body, ToBodyPose(fit.person.body, pose));
    for (const FitView& view : studio.steps[frame].views) ious.push_back(SilhouetteIou(fit.person.body, vertices, view));
  }
  return Mean(ious);
}

BodyFit FitTo(const Studio& studio, double thickest_m = 0.15) {
  BodyFit fit = FitBody(studio.rest, studio.steps, {}, {});
  EXPECT_EQ(fit.status, Status::kOk);
  EXPECT_TRUE(fit.person.body.vertices.allFinite());
  EXPECT_TRUE(fit.offsets.allFinite());
  const BodyTemplate unfitted = Unfitted(studio);
  EXPECT_EQ(RotatedBetween(unfitted, fit.person.body), 0);
  EXPECT_LE(RotatedBetween(studio.rest, unfitted), 0) << "of " << studio.rest.faces.cols();
  EXPECT_LT(fit.offsets.cwiseAbs().maxCoeff(), thickest_m);
  return fit;
}

TEST(FitDegenerate, OneViewFromTheFrontLeavesDepthToTheTemplate) {
  const Studio studio(StudioOptions{20, 1});
  const BodyFit fit = FitTo(studio);
  EXPECT_GT(MeanIou(studio, fit), fit.iou_before + 0.02);
}

TEST(FitDegenerate, AStillPersonIsFitted) {
  const Studio studio(StudioOptions{20, 5, 1.82, 0});
  const BodyFit fit = FitTo(studio);
  EXPECT_GT(fit.iou, 0.95);
}

TEST(FitDegenerate, AChildIsFitted) {
  const Studio studio(StudioOptions{20, 5, 1.05});
  const BodyFit fit = FitTo(studio);
  EXPECT_GT(fit.iou, fit.iou_before + 0.02);
  EXPECT_GT(fit.iou, 0.9);
}

TEST(FitDegenerate, ASkirtIsFittedOrLeftOutButNotATangle) {
  const Studio studio(StudioOptions{20, 5, 1.75, 0.15, true});
  const BodyFit fit = FitTo(studio, 0.3);
  EXPECT_GE(fit.iou, fit.iou_before);
}

TEST(FitDegenerate, MissingLimbsLeaveTheRest) {
  Studio studio(20);
  Rng rng(3);
  for (FitStep& step : studio.steps) {
    for (const int j : {4, 5, 7, 8, 10, 11, 13, 14}) step.joints.valid[j] = rng.Uniform() > 0.5;  // elbows to ankles
  }
  const BodyFit fit = FitTo(studio);
  EXPECT_GT(fit.iou, fit.iou_before);
  for (FitStep& step : studio.steps) step.joints.valid[5] = step.joints.valid[11] = false;  // a wrist, an ankle: in no frame
  const BodyFit blind = FitTo(studio);
  EXPECT_GT(blind.iou, blind.iou_before);
}

}  // namespace
}  // namespace mvstudio::body
