#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/mesh_raster.h"
#include "core/image.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

/// One image of the person.
struct TextureView {
  geometry::RigCamera camera;
  Image image;                         ///< (H, W, 3)
  Image mask;                          ///< (H, W, 1), 255: person
  Eigen::Matrix3Xf vertices_in_world;  ///< (3, V) posed for this image
  int camera_idx = 0;                  ///< views of one camera share its colour gains
};

/// What an image shows of a point of the surface.
struct ViewSample {
  float weight = 0;  ///< px^2: cos^2 of the angle of sight times (focal length / depth)^2
  Eigen::Vector2d px;
  std::array<uint8_t, 3> colour{};
};

/// The colours that one image shows of the surface. Only what is seen steeply enough, inside the mask, with nothing of the body
/// before it and no edge of depth nearby. Both arguments must outlive it.
class ViewSampler {
 public:
  ViewSampler(const BodyTemplate& body, const TextureView& view);

  /// The point with these barycentric weights of a face's corners; nothing where the image does not show it.
  std::optional<ViewSample> At(int face, const Eigen::Vector3f& barycentric) const;
  /// Where a vertex lies in the image, visible or not; nothing behind the camera or outside the image.
  std::optional<Eigen::Vector2d> VertexPx(int vertex) const;
  const PartUvMap& map() const { return map_; }

 private:
  const BodyTemplate& body_;
  const TextureView& view_;
  PartUvMap map_;
  std::vector<Eigen::Vector3f> in_cam_;  // (V)
  geometry::Projector projector_;
};

/// Four masks around the pixel say person: no background is mixed in.
bool InsideMask(const Image& mask, const Eigen::Vector2d& px);
/// Nothing of the body lies before `z`, m, and no edge of depth is near.
bool NothingBefore(const PartUvMap& map, const Eigen::Vector2d& px, double z);
/// Colour between four pixels; coordinates beyond the outermost centres are those of the edge. The image has at least 2 x 2 px.
std::array<uint8_t, 3> BilinearColour(const Image& image, const Eigen::Vector2d& px);

/// Colours over a camera's gains, at most 255.
Image WithoutGain(Image image, const Eigen::Array3d& gain);

/// The same view in pixels whose edge is 1 / `times` as long.
geometry::RigCamera FinerCamera(const geometry::RigCamera& camera, int times);

}  // namespace mvstudio::body
