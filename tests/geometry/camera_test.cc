#include "geometry/lens/camera.h"

#include <limits>

#include "core/error.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

TEST(LensModel, NamesGoBothWays) {
  for (const LensModel model : kAllLensModels) EXPECT_EQ(LensModelFromString(ToString(model)), model);
  EXPECT_FALSE(LensModelFromString("fisheye"));
  EXPECT_FALSE(LensModelFromString(""));
  std::optional<LensModel> model;
  for (const auto& [name, here] : {std::pair("opencv8", "rational8"), std::pair("LENSMODEL_OPENCV4", "brown4"),
                                   std::pair("equidistant", "kannala4"), std::pair("ds", "doublesphere")}) {
    const std::string words = std::string(name) + " is " + here + " here";
    try {
      FromString(name, "model", &model);
      ADD_FAILURE() << name;
    } catch (const UsageError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  }
}

TEST(LensModel, ParamNamesFollowOpenCv) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    EXPECT_EQ(ParamNames(camera).size(), static_cast<size_t>(NumParams(camera))) << camera.name;
    EXPECT_EQ(camera.params.size(), NumParams(camera)) << camera.name;
    EXPECT_EQ(WhyInvalidLens(camera), "") << camera.name;
  }
  const std::vector<std::string> rational = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  EXPECT_EQ(ParamNames(LensModel::kRational8), rational);
  const std::vector<std::string> kannala = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  EXPECT_EQ(ParamNames(LensModel::kKannalaBrandt4), kannala);
}

TEST(LensModel, OrderAndWidth) {
  const std::vector<LensModel> models = ModelsSimplestFirst();
  EXPECT_EQ(models.size(), std::size(kAllLensModels) - 1);
  EXPECT_EQ(models.front(), LensModel::kPinhole);
  EXPECT_EQ(models.back(), LensModel::kThinPrism12);
  for (size_t i = 1; i < models.size(); ++i) EXPECT_LE(NumParams(models[i - 1]), NumParams(models[i]));
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const bool sees_sideways = Projector(camera).Project({1, 0, -0.01}).status != Status::kBehindCamera;
    EXPECT_EQ(IsWide(camera.model), sees_sideways) << camera.name;
  }
  EXPECT_EQ(kAllLensModels[static_cast<int>(LensModel::kSplined)], LensModel::kSplined);
  for (const LensModel model : kAllLensModels) EXPECT_EQ(kAllLensModels[static_cast<int>(model)], model);
  EXPECT_THROW(NumParams(LensModel::kSplined), ContractViolation);
}

TEST(LensModel, SplinedParametersFollowTheGrid) {
  const Camera camera = testing::MakeSplined({3, 11, 10, 150}, 0.01);
  EXPECT_EQ(NumParams(camera), 4 + 2 * 11 * 10);
  EXPECT_EQ(ParamNames(camera)[4 + 2 * (11 * 2 + 5) + 1], "uy_2_5");
}

TEST(Camera, PinholeOfAgreesAtTheAxis) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Camera pinhole = PinholeOf(camera);
    const Eigen::Vector3d x(1e-6, 2e-6, 1);
    EXPECT_LT((Project(pinhole, x).px - Project(camera, x).px).norm(), 1e-4) << camera.name;
    EXPECT_LT((Project(pinhole, {0, 0, 1}).px - Project(camera, {0, 0, 1}).px).norm(), 1e-12) << camera.name;
  }
}

TEST(Camera, PinholeIsCentred) {
  const Camera camera = MakePinhole("a", 641, 481, 500);
  EXPECT_EQ(camera.cx(), 320);
  EXPECT_EQ(camera.cy(), 240);
  EXPECT_EQ(camera.K()(0, 0), 500);
  EXPECT_EQ(camera.K()(2, 2), 1);
}

TEST(Camera, ValidateNamesTheCamera) {
  const Camera good = testing::MakeLens(LensModel::kBrown2, {0.1, 0.2});
  EXPECT_NO_THROW(Validate(good));
  const auto expect_refused = [&](auto&& spoil) {
    Camera camera = good;
    camera.name = "cam_07";
    spoil(camera);
    try {
      Validate(camera);
      FAIL() << "accepted";
    } catch (const ContractViolation& error) {
      EXPECT_NE(std::string(error.what()).find("cam_07"), std::string::npos) << error.what();
    }
  };
  expect_refused([](Camera& c) { c.width_px = 0; });
  expect_refused([](Camera& c) { c.height_px = -3; });
  expect_refused([](Camera& c) { c.params.conservativeResize(5); });
  expect_refused([](Camera& c) { c.params[0] = 0; });
  expect_refused([](Camera& c) { c.params[1] = -900; });
  expect_refused([](Camera& c) { c.params[5] = std::numeric_limits<double>::quiet_NaN(); });
  expect_refused([](Camera& c) { c.params[2] = std::numeric_limits<double>::infinity(); });
}

TEST(Camera, ValidateRefusesLensesWithoutAFormulaOnTheAxis) {
  EXPECT_THROW(Validate(testing::MakeLens(LensModel::kUcm, {-1})), ContractViolation);
  EXPECT_THROW(Validate(testing::MakeLens(LensModel::kDoubleSphereP, {-1.5, 0.5, 0, 0})), ContractViolation);
  EXPECT_THROW(Validate(testing::MakeLens(LensModel::kEucm, {0.5, 0})), ContractViolation);
  const Camera good = testing::MakeSplined({3, 11, 10, 150}, 0.01);
  EXPECT_NO_THROW(Validate(good));
  for (const SplineGrid& grid :
       {SplineGrid{4, 11, 10, 150}, SplineGrid{3, 3, 10, 150}, SplineGrid{3, 11, 10, 360}, SplineGrid{3, 10, 10, 150},
        SplineGrid{3, -11, -10, 150}, SplineGrid{3, 1 << 30, 1 << 30, 9}}) {
    Camera camera = good;
    camera.spline = grid;
    EXPECT_THROW(Validate(camera), ContractViolation);
  }
}

TEST(Camera, InImageIncludesTheOuterHalfPixels) {
  const Camera camera = MakePinhole("a", 10, 5, 10);
  EXPECT_TRUE(InImage(camera, {-0.5, -0.5}));
  EXPECT_TRUE(InImage(camera, {9.49, 4.49}));
  EXPECT_FALSE(InImage(camera, {9.5, 0}));
  EXPECT_FALSE(InImage(camera, {0, -0.51}));
  EXPECT_FALSE(InImage(camera, {std::nan(""), 0}));
}

}  // namespace
}  // namespace mvstudio::geometry
