#include "geometry/camera.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/error.h"
#include "tests/geometry/lens_samples.h"

namespace mvstudio::geometry {
namespace {

TEST(LensModel, NamesGoBothWays) {
  for (const LensModel model : kAllLensModels) EXPECT_EQ(LensModelFromString(ToString(model)), model);
  EXPECT_FALSE(LensModelFromString("fisheye"));
  EXPECT_FALSE(LensModelFromString(""));
}

TEST(LensModel, ParamNamesFollowOpenCv) {
  for (const LensModel model : kAllLensModels) EXPECT_EQ(ParamNames(model).size(), static_cast<size_t>(NumParams(model)));
  const std::vector<std::string> rational = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  EXPECT_EQ(ParamNames(LensModel::kRational8), rational);
  const std::vector<std::string> kannala = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  EXPECT_EQ(ParamNames(LensModel::kKannalaBrandt4), kannala);
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
