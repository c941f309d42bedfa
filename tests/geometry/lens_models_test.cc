#include <cmath>
#include <set>

#include "core/random.h"
#include "core/units.h"
#include "geometry/lens/camera.h"
#include "geometry/lens/camera_model.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/lens/models.h"
#include "geometry/lens/plane_distortion.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

/// What models.h asks of every struct of its list, so that a new one is tested as soon as it stands there.
namespace mvstudio::geometry {
namespace {

std::vector<LensModel> ModelsWithoutGrid() { return {std::begin(kAllLensModels), std::end(kAllLensModels) - 1}; }

/// A lens whose parameters lie within `spread` of the ordinary ones.
Camera RandomLens(LensModel model, double spread, Rng* rng) {
  std::vector<double> distortion;
  for (int i = 0; i < TraitsOf(model).num_params; ++i) {
    distortion.push_back(TraitsOf(model).params[i].ordinary * (1 + spread * rng->Uniform(-1, 1)));
  }
  return testing::MakeLens(model, distortion, 1280, 960, IsWide(model) ? 420 : 900);
}

Eigen::Vector3d RandomRay(const Camera& camera, Rng* rng) {
  return Direction(camera.model, rng->Uniform(0.01, testing::Reach(camera)), rng->Uniform(0, 2 * kPi)) * rng->Uniform(0.5, 8);
}

TEST(LensModels, NamesAreUnique) {
  std::set<std::string_view> names;
  for (const LensModel model : kAllLensModels) {
    const LensTraits& traits = TraitsOf(model);
    EXPECT_TRUE(names.insert(traits.name).second) << traits.name;
    std::set<std::string_view> params = {"fx", "fy", "cx", "cy"};
    for (int i = 0; i < traits.num_params; ++i) {
      EXPECT_TRUE(params.insert(traits.params[i].name).second) << traits.name << " " << traits.params[i].name;
    }
  }
}

TEST(LensModels, CountsAreThoseOfTheStructs) {
  for (const LensModel model : ModelsWithoutGrid()) {
    const size_t count =
        internal::VisitLens(model, {}, [](auto lens) { return std::tuple_size_v<std::decay_t<decltype(lens.kParams)>>; });
    EXPECT_EQ(NumDistortionParams(model), static_cast<int>(count)) << ToString(model);
    EXPECT_EQ(ParamNames(model).size(), 4 + count) << ToString(model);
    EXPECT_LE(4 + static_cast<int>(count), LensDerivatives::kMax) << ToString(model);
  }
  EXPECT_TRUE(TraitsOf(kAllLensModels[std::size(kAllLensModels) - 1]).has_grid);
}

TEST(LensModels, OrdinaryLensesAreValidAndLimitsAreNot) {
  Rng rng(1);
  for (const LensModel model : ModelsWithoutGrid()) {
    const Camera ordinary = RandomLens(model, 0, &rng);
    EXPECT_EQ(WhyInvalidLens(ordinary), "") << ToString(model);
    EXPECT_GT(ValidRadius(ordinary), 0.3) << ToString(model);
    for (int i = 0; i < TraitsOf(model).num_params; ++i) {
      const LensParam& param = TraitsOf(model).params[i];
      for (const double value : {param.ordinary, param.start}) {
        EXPECT_TRUE(value > param.above && value >= param.low && value <= param.high) << ToString(model) << " " << param.name;
      }
      if (std::isinf(param.above)) continue;
      Camera limit = ordinary;
      limit.params[4 + i] = param.above;
      EXPECT_NE(WhyInvalidLens(limit).find(param.name), std::string::npos) << ToString(model);
    }
  }
}

TEST(LensModels, SimplerModelsHaveFewerTerms) {
  for (const LensModel model : ModelsWithoutGrid()) {
    const auto simpler = TraitsOf(model).simpler;
    if (!simpler) continue;
    EXPECT_LT(NumParams(*simpler), NumParams(model)) << ToString(model);
    EXPECT_EQ(IsWide(*simpler), IsWide(model)) << ToString(model);
  }
  EXPECT_EQ(WithDecentring(LensModel::kUcm), LensModel::kUcmP);
  EXPECT_EQ(WithDecentring(LensModel::kKannalaBrandt4), LensModel::kKannalaBrandt4P);
  EXPECT_EQ(WithDecentring(LensModel::kBrown2), LensModel::kBrown4);
  EXPECT_FALSE(WithDecentring(LensModel::kBrown5));
}

TEST(LensModels, OpenCvTermsStandInOpenCvsOrder) {
  const Camera camera = testing::MakeLens(LensModel::kBrown1P, {-0.12, 0.0011, -0.0017});
  Eigen::Matrix<double, 12, 1> expected = Eigen::Matrix<double, 12, 1>::Zero();
  expected.head<4>() << -0.12, 0, 0.0011, -0.0017;
  EXPECT_EQ(*OpenCvTerms(camera), expected);
  EXPECT_TRUE(HasOpenCvOrder(LensModel::kPinhole) && HasOpenCvOrder(LensModel::kThinPrism12));
  EXPECT_FALSE(HasOpenCvOrder(LensModel::kBrown1P) || HasOpenCvOrder(LensModel::kPinholeP));
  EXPECT_FALSE(OpenCvTerms(testing::MakeLens(LensModel::kUcm, {1})));
  EXPECT_FALSE(HasOpenCvOrder(LensModel::kKannalaBrandt4));
}

TEST(LensModels, TheProgramProjectsByTheFormula) {
  Rng rng(2);
  for (const LensModel model : ModelsWithoutGrid()) {
    for (int i = 0; i < 100; ++i) {
      const Camera camera = RandomLens(model, 0.5, &rng);
      const Eigen::Vector3d x = RandomRay(camera, &rng);
      Eigen::Vector2d px, formula;
      ASSERT_TRUE(ProjectLens(camera, x, &px, nullptr)) << camera.name;
      ASSERT_TRUE(ProjectByFormula<double>(model, camera.params.data(), x, &formula));
      ASSERT_DOUBLE_EQ(px[0], formula[0]) << camera.name;
      ASSERT_DOUBLE_EQ(px[1], formula[1]) << camera.name;
    }
  }
}

/// Central differences in long double, right to about 12 digits.
template <class Function>
Eigen::Vector2d Difference(const Function& f, long double at) {
  const long double h = 1e-6L * (1 + std::abs(at));
  return ((f(at + h) - f(at - h)) / (2 * h)).template cast<double>();
}

TEST(LensModels, DerivativesAreThoseOfTheFormula) {
  using Vector2l = Eigen::Matrix<long double, 2, 1>;
  Rng rng(3);
  for (const LensModel model : ModelsWithoutGrid()) {
    for (int i = 0; i < 50; ++i) {
      const Camera camera = RandomLens(model, 0.5, &rng);
      const Eigen::Vector3d x = RandomRay(camera, &rng);
      Eigen::Vector2d px;
      LensDerivatives d;
      ASSERT_TRUE(ProjectLens(camera, x, &px, &d)) << camera.name;
      ASSERT_EQ(d.count, camera.params.size());
      for (int j = 0; j < d.count + 3; ++j) {
        const auto f = [&](long double value) {
          Eigen::Matrix<long double, Eigen::Dynamic, 1> params = camera.params.cast<long double>();
          Eigen::Matrix<long double, 3, 1> point = x.cast<long double>();
          (j < d.count ? params[j] : point[j - d.count]) = value;
          Vector2l pixel = Vector2l::Zero();
          ProjectByFormula<long double>(model, params.data(), point, &pixel);
          return pixel;
        };
        const bool param = j < d.count;
        const Eigen::Vector2d expected = Difference(f, param ? camera.params[j] : x[j - d.count]);
        Eigen::Vector2d closed_form = d.d_px_d_x_in_cam.col(param ? 0 : j - d.count);
        if (param) closed_form = d.d_px.col(j);
        ASSERT_LT((closed_form - expected).norm(), 1e-7 * (1 + expected.norm())) << camera.name << " " << j;
      }
    }
  }
}

TEST(LensModels, UnprojectionReturnsTheRay) {
  Rng rng(4);
  for (const LensModel model : ModelsWithoutGrid()) {
    for (int i = 0; i < 50; ++i) {
      const Camera camera = RandomLens(model, 0.3, &rng);
      const Projector projector(camera);
      const Eigen::Vector3d ray = RandomRay(camera, &rng).normalized();
      const Projection there = projector.Project(ray);
      ASSERT_EQ(there.status, Status::kOk) << camera.name;
      const Unprojection back = projector.Unproject(there.px);
      ASSERT_EQ(back.status, Status::kOk) << camera.name;
      ASSERT_LT((back.ray_in_cam - ray).norm(), 1e-9) << camera.name;
    }
  }
}

/// Zero for the terms that the radial function leaves out.
Camera WithoutAsymmetry(Camera camera) {
  for (int i = 0; i < TraitsOf(camera.model).num_params; ++i) {
    if (TraitsOf(camera.model).params[i].IsAsymmetric()) camera.params[4 + i] = 0;
  }
  camera.params.head<4>() << 1, 1, 0, 0;
  return camera;
}

TEST(LensModels, RadialFunctionsAreThoseOfTheFormula) {
  Rng rng(5);
  for (const LensModel model : ModelsWithoutGrid()) {
    for (int i = 0; i < 50; ++i) {
      const Camera camera = WithoutAsymmetry(RandomLens(model, 0.5, &rng));
      const double radius = rng.Uniform(0.01, testing::Reach(camera)), *k = camera.params.data() + 4;
      const auto radial = [&](double at) {
        Eigen::Vector2d px(0, 0);
        ProjectByFormula<double>(model, camera.params.data(), Direction(model, at, 0), &px);
        return px[0];
      };
      internal::VisitLens(model, {}, [&](auto lens) {
        if constexpr (!decltype(lens)::kHasGrid) {
          const double fold = lens.FirstFold(k);
          const internal::RadialValue found = lens.Radial(k, radius);
          EXPECT_NEAR(found.value, radial(radius), 1e-14) << camera.name;
          const double slope = (radial(radius + 1e-5) - radial(radius - 1e-5)) / 2e-5;
          EXPECT_NEAR(found.slope, slope, 1e-8 * (1 + slope)) << camera.name;
          EXPECT_GT(found.slope, 0) << camera.name;
          EXPECT_LE(found.value, lens.LargestRadius(k, fold)) << camera.name;
          EXPECT_NEAR(lens.InvertRadial(k, found.value, fold), radius, 1e-9) << camera.name;
          EXPECT_NEAR(lens.AxisScale(k), 1 / lens.Radial(k, 0).slope, 1e-14) << camera.name;
        }
      });
    }
  }
}

TEST(LensModels, ArithmeticModelsHaveAFormOnTheImagePlane) {
  Rng rng(6);
  for (const LensModel model : ModelsWithoutGrid()) {
    if (!TraitsOf(model).arithmetic) continue;
    EXPECT_FALSE(IsWide(model));
    for (int i = 0; i < 50; ++i) {
      const Camera camera = RandomLens(model, 0.5, &rng);
      const Eigen::Vector3d x = RandomRay(camera, &rng);
      Eigen::Vector2d px;
      LensDerivatives d;
      ASSERT_TRUE(ProjectLens(camera, x, &px, &d));
      const auto m = DistortPlane(model, camera.params.data() + 4, x[0] / x[2], x[1] / x[2]);
      EXPECT_NEAR(camera.fx() * m.a + camera.cx(), px[0], 1e-10) << camera.name;
      EXPECT_NEAR(camera.fy() * m.b + camera.cy(), px[1], 1e-10) << camera.name;
      Eigen::Matrix2d slopes;
      slopes << camera.fx() * m.a_by_a, camera.fx() * m.a_by_b, camera.fy() * m.b_by_a, camera.fy() * m.b_by_b;
      EXPECT_LT((slopes / x[2] - d.d_px_d_x_in_cam.leftCols<2>()).norm(), 1e-10 * slopes.norm()) << camera.name;
    }
  }
}

TEST(LensModels, StartsAreLenses) {
  for (const LensModel model : ModelsWithoutGrid()) {
    const auto starts = internal::VisitLens(model, {}, [](auto lens) {
      std::vector<std::vector<double>> all = lens.FitStarts();
      for (const std::vector<double>& basin : lens.Basins()) all.push_back(basin);
      return all;
    });
    for (const std::vector<double>& start : starts) {
      ASSERT_LE(static_cast<int>(start.size()), NumDistortionParams(model));
      std::vector<double> distortion = start;
      distortion.resize(static_cast<size_t>(NumDistortionParams(model)));
      EXPECT_EQ(WhyInvalidLens(testing::MakeLens(model, distortion)), "") << ToString(model);
    }
  }
}

}  // namespace
}  // namespace mvstudio::geometry
