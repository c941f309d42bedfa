#include "calib/bundle/view.h"

#include "core/error.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Central difference of the residuals along one left perturbation or parameter.
template <class Change>
Eigen::VectorXd Difference(const View& view, const RigState& truth, const Change& change) {
  constexpr double kStep = 1e-6;
  Eigen::VectorXd sides[2];
  for (int side = 0; side < 2; ++side) {
    geometry::Camera camera = truth.cameras[view.camera_idx];
    geometry::Rigid3 cam_from_board = CamFromBoard(view, truth);
    change(side ? kStep : -kStep, &camera, &cam_from_board);
    const auto residuals = ResidualsOf(view, camera, cam_from_board);
    sides[side] = Eigen::Map<const Eigen::VectorXd>(residuals->data(), residuals->size());
  }
  return (sides[1] - sides[0]) / (2 * kStep);
}

class LinearizeViewTest : public ::testing::TestWithParam<geometry::LensModel> {};

TEST_P(LinearizeViewTest, AgreesWithFiniteDifferences) {
  SceneOptions options;
  options.model = GetParam();
  const auto scene = MakeScene(options);
  std::vector<int64_t> frames;
  const View view = MakeViews({scene.board}, scene.detections, &frames)[3];
  const RigState& truth = scene.truth;
  ASSERT_EQ(frames, truth.frames);
  const auto linear = LinearizeView(view, truth.cameras[view.camera_idx], CamFromBoard(view, truth));
  ASSERT_TRUE(linear);
  EXPECT_LT(linear->residuals.cwiseAbs().maxCoeff(), 1e-9);
  for (int i = 0; i < 6; ++i) {
    const Eigen::VectorXd pose = Difference(view, truth, [&](double step, auto*, auto* cam_from_board) {
      *cam_from_board = geometry::Perturb(step * geometry::Vector6d::Unit(i), *cam_from_board);
    });
    EXPECT_LT((pose - linear->d_pose.col(i)).cwiseAbs().maxCoeff(), 1e-5 * pose.norm()) << i;
  }
  for (int i = 0; i < linear->d_lens.cols(); ++i) {
    const Eigen::VectorXd params =
        Difference(view, truth, [&](double step, auto* camera, auto*) { camera->params[i] += step; });
    EXPECT_LT((params - linear->d_lens.col(i)).cwiseAbs().maxCoeff(), 1e-5 * std::max(1.0, params.norm())) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Models, LinearizeViewTest,
                         ::testing::Values(geometry::LensModel::kPinhole, geometry::LensModel::kBrown4,
                                           geometry::LensModel::kRational8, geometry::LensModel::kKannalaBrandt4));

TEST(LinearizeView, FailsBehindTheCameraUnlessTheCornerHasNoWeight) {
  const auto scene = MakeScene({});
  std::vector<int64_t> frames;
  View view = MakeViews({scene.board}, scene.detections, &frames)[0];
  geometry::Rigid3 behind;
  behind.translation = {0, 0, -1};
  EXPECT_FALSE(LinearizeView(view, scene.truth.cameras[0], behind));
  view.weights.setZero();
  const auto linear = LinearizeView(view, scene.truth.cameras[0], behind);
  ASSERT_TRUE(linear);
  EXPECT_EQ(linear->residuals.norm(), 0);
}

TEST(MakeView, RefusesACornerThatIsNotOnTheBoard) {
  auto scene = MakeScene({});
  scene.detections[0].corner_ids[0] = 54;
  std::vector<int64_t> frames;
  EXPECT_THROW(MakeViews({scene.board}, scene.detections, &frames), ContractViolation);
}

TEST(HalfOf, SplitsWithoutLoss) {
  const auto scene = MakeScene({});
  std::vector<int64_t> frames;
  const View view = MakeViews({scene.board}, scene.detections, &frames)[0];
  const View even = HalfOf(view, 0), odd = HalfOf(view, 1);
  EXPECT_EQ(even.size() + odd.size(), view.size());
  EXPECT_EQ(odd.corner_ids[0], view.corner_ids[1]);
  EXPECT_EQ(even.px.col(1), view.px.col(2));
}

}  // namespace
}  // namespace mvstudio::calib
