#include "calib/covariance/omitted_terms.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "calib/covariance/projection_uncertainty.h"
#include "calib/covariance/uncertainty.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

struct Solved {
  std::vector<View> views;
  RigState state;
  BundleReport report;
};

/// Boards of lenses with a decentring, adjusted with lenses that have none.
Solved SolvedWithout(double p1, double p2, LensModel model, double noise_px, uint64_t seed) {
  testing::SceneOptions options;
  options.model = LensModel::kBrown4;
  options.seed = seed;
  testing::Scene scene = testing::MakeScene(options);
  for (geometry::Camera& camera : scene.truth.cameras) camera.params.tail<2>() << p1, p2;
  testing::ObserveAll(&scene, noise_px, seed + 50);
  Solved solved;
  solved.state = scene.truth;
  for (geometry::Camera& camera : solved.state.cameras) {
    camera.model = model;
    camera.params.conservativeResize(geometry::NumParams(model));
  }
  solved.views = MakeViews({scene.board}, scene.detections, &solved.state.frames);
  solved.report = SolveBundle(&solved.views, &solved.state, {});
  return solved;
}

RigCovariance CovarianceOf(const Solved& solved, const WithOmitted& with) {
  return ComputeCovariance(solved.views, with.state, with.options, solved.report.sigma_px);
}

TEST(OmittedTerms, ProjectionsStayAndFixedModelsStay) {
  const Solved solved = SolvedWithout(0, 0, LensModel::kBrown2, 0.2, 1);
  const WithOmitted with = AddOmittedTerms(solved.state, {}, {true, false}, solved.report.sigma_px);
  EXPECT_EQ(with.state.cameras[0].model, LensModel::kBrown5);
  EXPECT_EQ(with.state.cameras[1].model, LensModel::kBrown2);
  const auto a = BundleResiduals(solved.views, solved.state), b = BundleResiduals(solved.views, with.state);
  for (size_t v = 0; v < a.size(); ++v) EXPECT_LT((a[v] - b[v]).norm(), 1e-9);
  EXPECT_EQ(with.options.lens_prior[1].weight.size(), 0);
}

TEST(OmittedTerms, EveryModelHasAllItsNumbersAndAPriorOnTheNewOnesAlone) {
  for (const LensModel model : geometry::kAllLensModels) {
    if (model == LensModel::kSplined) continue;
    RigState state;
    state.cameras = {testing::MakeCamera("a", model, 300)};
    const Eigen::VectorXd before = state.cameras[0].params;
    const WithOmitted with = AddOmittedTerms(state, {}, {true}, 0.2);
    const geometry::Camera& camera = with.state.cameras[0];
    EXPECT_EQ(camera.params.size(), geometry::NumParams(camera.model)) << geometry::ToString(model);
    EXPECT_EQ(camera.params.head(before.size()), before);
    EXPECT_TRUE(camera.params.tail(camera.params.size() - before.size()).isZero(0));
    if (camera.model == model) continue;
    const Eigen::VectorXd& weight = with.options.lens_prior[0].weight;
    ASSERT_EQ(weight.size(), camera.params.size());
    EXPECT_TRUE(weight.head(before.size()).isZero(0));
    EXPECT_GT(weight.tail(camera.params.size() - before.size()).minCoeff(), 0);
    EXPECT_EQ(with.options.lens_prior[0].num_omitted, camera.params.size() - before.size());
    const Eigen::Vector3d x(0.1, -0.2, 1);
    geometry::Camera old = camera;
    old.model = model, old.params = before;
    EXPECT_LT((geometry::Projector(old).Project(x).px - geometry::Projector(camera).Project(x).px).norm(), 1e-9);
  }
}

TEST(OmittedTerms, TheCentreIsAsUncertainAsWithTheTermsButNoMoreThanThePriorAllows) {
  const Solved solved = SolvedWithout(0, 0, LensModel::kBrown2, 0.2, 1);
  WithOmitted with = AddOmittedTerms(solved.state, {}, {true, true}, solved.report.sigma_px);
  const auto sigma = [&](const RigCovariance& covariance) { return std::sqrt(covariance.params[0](2, 2)); };
  const double lean = sigma(ComputeCovariance(solved.views, solved.state, BundleOptions(), solved.report.sigma_px));
  const double stated = sigma(CovarianceOf(solved, with));
  for (LensPrior& prior : with.options.lens_prior) prior.weight.setZero();
  const double rich = sigma(CovarianceOf(solved, with));
  EXPECT_GT(stated, 1.2 * lean);
  EXPECT_LT(stated, rich);
}

TEST(OmittedTerms, TheShiftIsTheRicherSolutionLessTheLeanOne) {
  Rng rng(3);
  Eigen::MatrixXd rows(12, 6);
  for (Eigen::Index i = 0; i < rows.size(); ++i) rows.data()[i] = rng.Normal();
  const Eigen::MatrixXd normal = rows.transpose() * rows, inverse = normal.inverse();
  Eigen::VectorXd gradient(6);
  for (Eigen::Index i = 0; i < 6; ++i) gradient[i] = rng.Normal();
  const std::vector<Eigen::Index> omitted = {2, 5}, lean = {0, 1, 3, 4};
  Eigen::VectorXd expected = -normal.llt().solve(gradient);
  expected(lean) += Eigen::MatrixXd(normal(lean, lean)).llt().solve(Eigen::VectorXd(gradient(lean)));
  const Eigen::VectorXd shift = OmittedShift(inverse(Eigen::all, omitted), omitted, gradient);
  EXPECT_LT((shift - expected).norm(), 1e-10 * expected.norm());
}

/// A decentring ten times what the prior expects, of which the boards know.
TEST(OmittedTerms, SigmasCoverTermsThatTheBoardsSee) {
  const Solved solved = SolvedWithout(6e-3, -6e-3, LensModel::kBrown2, 0.2, 4);
  const WithOmitted with = AddOmittedTerms(solved.state, {}, {true, true}, solved.report.sigma_px);
  WithOmitted without_shift = with;
  for (LensPrior& prior : without_shift.options.lens_prior) prior.num_omitted = 0;
  const RigCovariance covariance = CovarianceOf(solved, with), narrow = CovarianceOf(solved, without_shift);
  const ProjectionUncertainty pixels(solved.views, with.state, with.options, solved.report.sigma_px);
  const ProjectionUncertainty narrow_pixels(solved.views, without_shift.state, without_shift.options, solved.report.sigma_px);
  for (int c = 0; c < 2; ++c) {
    for (int i = 2; i < 4; ++i) {
      const double error = solved.state.cameras[c].params[i] - (i == 2 ? 322.5 : 236.25);
      EXPECT_LT(std::abs(error), 3 * std::sqrt(covariance.params[c](i, i)));
      EXPECT_GT(std::abs(error), 5 * std::sqrt(narrow.params[c](i, i)));
    }
    const Eigen::Vector2d corner(10, 10);
    EXPECT_GT(pixels.PixelCovariance(c, corner, 2).worst_px(), narrow_pixels.PixelCovariance(c, corner, 2).worst_px());
  }
}

/// Lenses whose decentring is about what the boards cannot tell from none: errors of the centre over their sigmas.
TEST(OmittedTerms, SigmasCoverWhatTheBoardsCannotTell) {
  const Solved first = SolvedWithout(0, 0, LensModel::kBrown2, 0.2, 1);
  const WithOmitted rich = AddOmittedTerms(first.state, {}, {true, true}, first.report.sigma_px);
  const double hidden = std::sqrt(CovarianceOf(first, rich).params[0](6, 6));
  Rng rng(5);
  double squares = 0, lean_squares = 0;
  int count = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Solved solved = SolvedWithout(hidden * rng.Normal(), hidden * rng.Normal(), LensModel::kBrown2, 0.2, seed);
    const WithOmitted with = AddOmittedTerms(solved.state, {}, {true, true}, solved.report.sigma_px);
    const RigCovariance covariance = CovarianceOf(solved, with);
    const RigCovariance lean = ComputeCovariance(solved.views, solved.state, BundleOptions(), solved.report.sigma_px);
    for (int c = 0; c < 2; ++c) {
      for (int i = 2; i < 4; ++i) {
        const double error = solved.state.cameras[c].params[i] - (i == 2 ? 322.5 : 236.25);
        squares += error * error / covariance.params[c](i, i), lean_squares += error * error / lean.params[c](i, i), ++count;
      }
    }
  }
  const double stated = std::sqrt(squares / count), without = std::sqrt(lean_squares / count);  // 1: honest
  EXPECT_NEAR(stated, 1, 0.3);
  EXPECT_GT(without, 1.25);
  EXPECT_LT(stated, without);
}

}  // namespace
}  // namespace mvstudio::calib
