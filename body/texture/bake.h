#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "body/body_template.h"
#include "body/texture/texel_map.h"
#include "core/image.h"
#include "core/progress.h"
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

using Textures = std::array<Image, kNumParts>;

/// Colours of the surface, in the layout of MannequinTextures. A texel takes the views that see it best (by the angle of sight
/// and the pixels that it covers), visible by depth and away from outlines; of these the mean about their median. Cameras'
/// gains are taken out, as far as they see the same texels. Texels that no view saw take the colours of their neighbours.
class TextureBaker {
 public:
  TextureBaker(const BodyTemplate& body, int size_px);

  /// Adds what one image shows. Thread-safe for different ranges of texels only: call from one thread; it runs `run`'s threads.
  void Add(const TextureView& view, const RunContext& run);
  /// Colours with the gains of cameras taken out.
  Textures Finish(const std::vector<Eigen::Array3d>& gains) const;
  /// How much brighter each camera shows a texel than all do, a channel each; their geometric mean is 1. Cameras that share too
  /// few texels with others have 1.
  std::vector<Eigen::Array3d> Gains() const;
  /// Share of the surface's texels that some view saw.
  double SeenShare() const;

 private:
  static constexpr int kSamples = 12;
  struct Sample {
    float weight = 0;
    int camera_idx = 0;
    std::array<uint8_t, 3> colour{};
  };
  /// The mean about the median of a texel's samples, each divided by its camera's gains; false: nobody saw it.
  bool ColourOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const;
  std::vector<Eigen::Array3d> RelativeGains(const std::vector<Eigen::Array3d>& gains) const;
  void AddTexel(const TextureView& view, const std::vector<Eigen::Vector3f>& in_cam, const std::vector<float>& depth,
                size_t texel);

  const BodyTemplate& body_;
  TexelMap map_;
  int num_cameras_ = 0;
  std::vector<Sample> samples_;  // (24, S, S, kSamples)
};

/// Textured body as a camera sees it, on black: colour and coverage are means over 4 x 4 samples a pixel.
struct RenderedBody {
  Image image;  ///< (H, W, 3), premultiplied
  Image cover;  ///< (H, W, 1)
};
RenderedBody RenderBody(const BodyTemplate& body, const Textures& textures, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera);

}  // namespace mvstudio::body
