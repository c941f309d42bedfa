#include <gtest/gtest.h>

#include <cmath>

#include "body/fit/fit_body.h"
#include "core/random.h"
#include "core/statistics.h"
#include "tests/body/fit_studio.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;
using testing::Studio;
using testing::StudioOptions;

Vector3d FaceNormal(const BodyTemplate& body, Eigen::Index f) {
  const Vector3d a = body.vertices.col(body.faces(0, f)).cast<double>();
  return (body.vertices.col(body.faces(1, f)).cast<double>() - a).cross(body.vertices.col(body.faces(2, f)).cast<double>() - a);
}

/// Faces of the fitted surface that look the other way than those of the same body without offsets.
int TurnedFaces(const BodyFit& fit) {
  BodyTemplate smooth = fit.person.body;
  smooth.vertices -= VertexNormals(smooth.vertices, smooth.faces) * fit.offsets.cast<float>().asDiagonal();
  int turned = 0;
  for (Eigen::Index f = 0; f < smooth.faces.cols(); ++f)
    turned += FaceNormal(fit.person.body, f).dot(FaceNormal(smooth, f)) < 0;
  return turned;
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

BodyFit FitTo(const Studio& studio) {
  BodyFit fit = FitBody(studio.rest, studio.steps, {}, {});
  EXPECT_EQ(fit.status, Status::kOk);
  EXPECT_TRUE(fit.person.body.vertices.allFinite());
  EXPECT_TRUE(fit.offsets.allFinite());
  EXPECT_EQ(TurnedFaces(fit), 0);
  EXPECT_LT(fit.offsets.cwiseAbs().maxCoeff(), 0.15) << "metres: nobody is that thick";
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
  const BodyFit fit = FitTo(studio);
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
  EXPECT_GT(FitTo(studio).iou, 0.8);
}

}  // namespace
}  // namespace mvstudio::body
