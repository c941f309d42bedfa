#include <gtest/gtest.h>

#include <cstdlib>
#include <regex>
#include <string>

#include "core/files.h"
#include "core/units.h"
#include "geometry/lens_fit.h"
#include "tests/geometry/lens_samples.h"
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
        ASSERT_LT((testing::ProjectLong(camera, back.ray_in_cam) - testing::Vector2ld(u, v)).norm(), 1e-9L) << name;
      }
    }
    std::printf("%s: %d of %d\n", name, solved, total);
  }
}

TEST(RealLenses, Fits) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  for (const char* name : kLenses) {
    const Camera camera = ReadLens(name);
    for (const LensModel to : {LensModel::kRational8, LensModel::kThinPrism12, LensModel::kKannalaBrandt4, LensModel::kKannalaBrandt4P, LensModel::kUcm, LensModel::kEucm, LensModel::kDoubleSphere, LensModel::kEucmP, LensModel::kSplined}) {
      const LensFit fit = FitLens(camera, to, {}, SplineGridFor(camera, 3, 20));
      std::printf("%-14s -> %-14s rms %8.4f max %8.4f rays %d lost %d angle %.1f %d\n", name + std::string(name).size() - 22, std::string(ToString(to)).c_str(), fit.rms_px, fit.max_px, fit.num_rays, fit.num_lost, RadToDeg(fit.max_angle), (int)fit.status);
    }
  }
}

}  // namespace
}  // namespace mvstudio::geometry
