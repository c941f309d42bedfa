#include "avatar/maps/camera_tensor.h"

#include <ATen/ATen.h>

#include <cmath>
#include <map>

#include "core/error.h"
#include "core/random.h"
#include "geometry/lens/camera_model.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

using geometry::LensModel;

/// The models with a projection over tensors.
std::vector<LensModel> Models() { return geometry::ModelsSimplestFirst(); }

/// Mild distortion of every model: fx, fy, cx, cy, then k.
std::vector<double> Params(LensModel model) {
  std::vector<double> params = {610, 590, 321.5, 238.25};
  const std::vector<std::string> names = geometry::ParamNames(model);
  const std::map<std::string, double> brown = {{"k1", -0.21}, {"k2", 0.06},  {"p1", 1e-3},  {"p2", -2e-3},
                                               {"k3", 0.011}, {"k4", 0.02},  {"k5", -0.01}, {"k6", 0.003},
                                               {"s1", 2e-3},  {"s2", -1e-3}, {"s3", -3e-3}, {"s4", 5e-4}};
  const std::map<std::string, double> wide = {{"k1", 0.05},  {"k2", -0.01}, {"k3", 0.004},  {"k4", -0.0007}, {"p1", 1e-3},
                                              {"p2", -2e-3}, {"xi", 0.7},   {"alpha", 0.6}, {"beta", 1.1}};
  for (size_t i = 4; i < names.size(); ++i) params.push_back((IsWide(model) ? wide : brown).at(names[i]));
  return params;
}

TEST(ProjectTensor, AgreesWithTheScalarFormulaForEveryLensModel) {
  Rng random(7);
  for (const LensModel model : Models()) {
    const std::vector<double> params = Params(model);
    const int64_t count = 200;
    const double wide = IsWide(model) ? 3.0 : 0.7;
    at::Tensor points = at::zeros({count, 3}, at::kDouble);
    for (int64_t i = 0; i < count; ++i) {
      const double z = random.Uniform(0.5, 6);
      points[i][0] = z * random.Uniform(-wide, wide), points[i][1] = z * random.Uniform(-wide, wide), points[i][2] = z;
    }
    points[0][0] = 0.0, points[0][1] = 0.0;  // the optical axis
    const at::Tensor px = ProjectTensor(std::string(geometry::ToString(model)), at::tensor(params, at::kDouble), points);
    for (int64_t i = 0; i < count; ++i) {
      const double* x = points.data_ptr<double>() + 3 * i;
      Eigen::Vector2d expected;
      ASSERT_TRUE(geometry::ProjectByFormula<double>(model, params.data(), Eigen::Vector3d(x[0], x[1], x[2]), &expected));
      EXPECT_NEAR(px[i][0].item<double>(), expected[0], 1e-9) << geometry::ToString(model);
      EXPECT_NEAR(px[i][1].item<double>(), expected[1], 1e-9) << geometry::ToString(model);
    }
  }
}

TEST(ProjectTensor, IsNanWhereTheFormulaIsUndefined) {
  const at::Tensor behind = at::tensor({0.1, 0.2, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2.0}, at::kDouble).view({3, 3});
  for (const LensModel model : Models()) {
    const at::Tensor px = ProjectTensor(std::string(geometry::ToString(model)), at::tensor(Params(model), at::kDouble), behind);
    for (int64_t i = 0; i < 3; ++i) {
      Eigen::Vector2d expected;
      const double* x = behind.data_ptr<double>() + 3 * i;
      const bool defined = geometry::ProjectByFormula<double>(model, Params(model).data(), {x[0], x[1], x[2]}, &expected);
      EXPECT_EQ(at::isnan(px[i]).all().item<bool>(), !defined) << geometry::ToString(model) << " " << i;
    }
  }
}

TEST(ProjectTensor, GradientAgreesWithCentralDifferences) {
  for (const LensModel model : Models()) {
    const std::string name(geometry::ToString(model));
    const at::Tensor params = at::tensor(Params(model), at::kDouble);
    at::Tensor point = at::tensor({0.4, -0.3, 1.7}, at::kDouble).requires_grad_();
    ProjectTensor(name, params, point)[0].backward();
    for (int64_t c = 0; c < 3; ++c) {
      const double h = 1e-6;
      at::Tensor step = at::zeros({3}, at::kDouble);
      step[c] = h;
      const at::Tensor x = point.detach();
      const double slope =
          ((ProjectTensor(name, params, x + step)[0] - ProjectTensor(name, params, x - step)[0]) / (2 * h)).item<double>();
      EXPECT_NEAR(point.grad()[c].item<double>(), slope, 1e-5 * std::max(1.0, std::abs(slope))) << name;
    }
  }
}

TEST(ProjectTensor, BroadcastsAndRefusesWhatDoesNotFit) {
  const at::Tensor intrinsics = at::tensor({500.0, 500.0, 10.0, 20.0, 100.0, 100.0, 0.0, 0.0}).view({2, 4}).to(at::kFloat);
  const at::Tensor px = ProjectPinhole(intrinsics, at::ones({2, 19, 3}, at::kFloat));
  EXPECT_EQ(px.sizes(), at::IntArrayRef({2, 19, 2}));
  EXPECT_FLOAT_EQ(px[0][5][1].item<float>(), 520.0f);
  EXPECT_FLOAT_EQ(px[1][18][0].item<float>(), 100.0f);
  EXPECT_THROW(ProjectTensor("splined", intrinsics, at::ones({2, 3})), UsageError);
  EXPECT_THROW(ProjectTensor("fisheye62", intrinsics, at::ones({2, 3})), UsageError);
  EXPECT_THROW(ProjectTensor("brown5", intrinsics, at::ones({2, 3})), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
