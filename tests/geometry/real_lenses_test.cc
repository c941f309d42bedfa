#include <cmath>
#include <cstdlib>
#include <regex>
#include <string>

#include "core/disk/files.h"
#include "core/units.h"
#include "geometry/lens/lens_fit.h"
#include "tests/geometry/exact_lens.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// Lenses that mrcal calibrated from real boards.
namespace mvstudio::geometry {
namespace {

/// The list of numbers that follows 'key'.
std::vector<double> NumbersAfter(const std::string& text, const std::string& key) {
  std::vector<double> numbers;
  const size_t begin = text.find('[', text.find("'" + key + "'")), end = text.find(']', begin);
  const char* at = text.c_str() + begin + 1;
  while (at < text.c_str() + end) {
    char* next = nullptr;
    const double number = std::strtod(at, &next);
    if (next != at) numbers.push_back(number);
    at = next == at ? at + 1 : next;
  }
  return numbers;
}

Camera ReadLens(const std::string& name) {
  const std::string text = ReadFile(mvstudio::testing::DataRoot() + "/mrcal_figueroa/" + name);
  Camera camera;
  camera.name = name;
  std::smatch grid;
  if (std::regex_search(text, grid, std::regex("order=(\\d)_Nx=(\\d+)_Ny=(\\d+)_fov_x_deg=(\\d+)"))) {
    camera.model = LensModel::kSplined;
    const std::string own = text.substr(text.find("'lensmodel'"));
    std::regex_search(own, grid, std::regex("order=(\\d)_Nx=(\\d+)_Ny=(\\d+)_fov_x_deg=(\\d+)"));
    camera.spline = {std::stoi(grid[1]), std::stoi(grid[2]), std::stoi(grid[3]), std::stoi(grid[4])};
  } else {
    camera.model = LensModel::kRational8;
  }
  const std::vector<double> params = NumbersAfter(text, "intrinsics"), size = NumbersAfter(text, "imagersize");
  camera.params = Eigen::Map<const Eigen::VectorXd>(params.data(), static_cast<Eigen::Index>(params.size()));
  camera.width_px = static_cast<int>(size.at(0)), camera.height_px = static_cast<int>(size.at(1));
  Validate(camera);
  return camera;
}

const char* const kLenses[] = {"doc/data/figueroa-overpass-looking-S/opencv8-0.cameramodel",
                               "doc/data/figueroa-overpass-looking-S/splined-0.cameramodel",
                               "doc/data/figueroa-overpass-looking-S/splined-1.cameramodel",
                               "test/data/cam0.opencv8.cameramodel", "test/data/cam0.splined.cameramodel"};

/// All pixels of the rational lenses; of the splined ones all but some at the border, where no board was and the surface runs
/// out of its grid.
TEST(RealLenses, EveryPixelHasAnExactRay) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  for (const char* name : kLenses) {
    const Camera camera = ReadLens(name);
    const Projector projector(camera);
    int solved = 0, total = 0;
    for (int v = 0; v < camera.height_px; v += 83) {
      for (int u = 0; u < camera.width_px; u += 89) {
        ++total;
        const Unprojection back = projector.Unproject({u, v});
        if (back.status != Status::kOk) continue;
        ++solved;
        ASSERT_LT((testing::ProjectExactly(camera, back.ray_in_cam) - testing::Vector2mp(u, v)).norm(), 1e-9L) << name;
      }
    }
    EXPECT_GE(solved, camera.model == LensModel::kSplined ? 0.995 * total : total) << name;
  }
}

/// The two solutions of one lens: the splined one looks 4 degrees aside (its surface hides the rotation), else they agree to a
/// few pixels where boards were.
TEST(RealLenses, SplinedAndRationalAreTheSameLensUpToARotation) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  const Camera splined = ReadLens(kLenses[1]), rational = ReadLens(kLenses[0]);
  LensFitOptions options;
  options.max_angle = DegToRad(45);
  const LensFit fixed = FitLens(splined, LensModel::kRational8, options);
  options.fit_rotation = true;
  const LensFit rotated = FitLens(splined, LensModel::kRational8, options);
  EXPECT_GT(fixed.rms_px, 20);
  EXPECT_LT(rotated.rms_px, 1);
  EXPECT_NEAR(RadToDeg(2 * std::acos(std::abs(rotated.new_from_old.w()))), 4, 0.3);
  const Projector ours(rotated.camera), theirs(rational);
  for (int v = 1000; v < 3000; v += 250) {
    for (int u = 2000; u < 3800; u += 300) {
      // The rotation between two fits of one lens is free: compare the angle between neighbours.
      const auto angle = [&](const Projector& projector) {
        const Eigen::Vector3d a = projector.Unproject({u, v}).ray_in_cam, b = projector.Unproject({u + 200, v}).ray_in_cam;
        return std::acos(a.dot(b));
      };
      EXPECT_NEAR(angle(ours) / angle(theirs), 1, 0.01) << u << " " << v;
    }
  }
}

TEST(RealLenses, OtherModelsComeNear) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  const Camera rational = ReadLens(kLenses[3]);
  const struct {
    LensModel to;
    double rms_px;
  } cases[] = {{LensModel::kThinPrism12, 1e-6},   {LensModel::kKannalaBrandt4P, 0.4},
               {LensModel::kKannalaBrandt4, 1.3}, {LensModel::kDoubleSphere, 1.8},
               {LensModel::kEucm, 3.5},           {LensModel::kUcm, 4.5},
               {LensModel::kSplined, 0.03}};
  for (const auto& [to, rms_px] : cases) {
    const LensFit fit = FitLens(rational, to, {}, SplineGridFor(rational, 3, 20));
    EXPECT_LT(fit.rms_px, rms_px) << ToString(to);
    EXPECT_EQ(fit.num_lost, 0) << ToString(to);
  }
}

}  // namespace
}  // namespace mvstudio::geometry
