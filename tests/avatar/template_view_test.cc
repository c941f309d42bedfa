#include "avatar/run/pack/template_view.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "avatar/body/mesh_raster.h"
#include "dataset/views/crop.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

constexpr int kSize = 64, kFiner = 4;

/// Looks at the mannequin's front from two metres, square.
geometry::RigCamera Camera(double heading) {
  geometry::RigCamera view;
  view.camera.model = geometry::LensModel::kPinhole;
  view.camera.width_px = view.camera.height_px = kSize;
  view.camera.params = Eigen::Vector4d(kSize * 1.1, kSize * 1.1, (kSize - 1) / 2.0, (kSize - 1) / 2.0);
  Eigen::Matrix3d down_is_minus_z;
  down_is_minus_z << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  view.cam_from_world.rotation = Eigen::Quaterniond(down_is_minus_z * turn);
  view.cam_from_world.translation = -(down_is_minus_z * Eigen::Vector3d(0, -2, 0.9));
  return view;
}

/// Where a chart's ends meet in a pixel, the mean of both lies in its middle: on the other side of the hand.
TEST(FillTemplateMaps, CoordinatesOfAPixelAreThoseOfOneOfItsPlaces) {
  const body::BodyTemplate body = body::MakeMannequin();
  int pixels = 0, jumps = 0;
  for (const double heading : {0.0, 0.8, 1.6, 3.1, 4.5}) {
    const geometry::RigCamera camera = Camera(heading);
    std::vector<float> maps(4 * kSize * kSize);
    FillTemplateMaps(body, body.vertices, camera, kSize, maps.data());
    const body::PartUvMap fine = RasterizeBody(body, body.vertices, dataset::ResizedCrop(camera, kFiner * kSize));
    for (int p = 0; p < kSize * kSize; ++p) {
      if (maps[p] == 0) continue;
      float nearest = 1, least = 1, most = 0;
      for (int i = 0; i < kFiner * kFiner; ++i) {
        const int at = (p / kSize * kFiner + i / kFiner) * fine.width + p % kSize * kFiner + i % kFiner;
        if (fine.part[at] != maps[kSize * kSize + p]) continue;
        nearest = std::min(nearest, std::abs(fine.u[at] - maps[2 * kSize * kSize + p]));
        least = std::min(least, fine.u[at]), most = std::max(most, fine.u[at]);
      }
      EXPECT_LT(nearest, 0.1f) << heading << ": " << p;
      ++pixels, jumps += most - least > 0.5f;
    }
  }
  EXPECT_GT(pixels, 1000);
  EXPECT_GT(jumps, 10) << "the views show ends of charts";
}

}  // namespace
}  // namespace mvstudio::avatar
