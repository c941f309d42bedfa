#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/texel_map.h"
#include "avatar/body/texture/view_sampler.h"
#include "core/image.h"
#include "core/progress.h"
#include "geometry/rig/rig.h"

namespace mvstudio::body {

using Textures = std::array<Image, kNumParts>;

/// Colours of the surface, in the layout of MannequinTextures. A texel takes the views that see it best (by the angle of sight
/// and the pixels that it covers), visible by depth and away from outlines; of these the mean about their median. Cameras'
/// gains are taken out, as far as they see the same texels. Texels that no view saw take the colours of their neighbours.
class TextureBaker {
 public:
  /// At most `samples_per_texel` (up to kMostSamples) views are kept of each texel.
  TextureBaker(const BodyTemplate& body, int size_px, int samples_per_texel = 12);
  static constexpr int kMostSamples = 64;

  /// Adds what one image shows. Thread-safe for different ranges of texels only: call from one thread; it runs `run`'s threads.
  void Add(const TextureView& view, const RunContext& run);
  /// Colours with the gains of cameras taken out.
  Textures Finish(const std::vector<Eigen::Array3d>& gains) const;
  /// The same with the weighted median of each channel, which no minority of the views moves (Alldieck et al., "Video Based
  /// Reconstruction of 3D People Models", CVPR 2018, take the median of the most orthogonal views).
  Textures FinishMedian(const std::vector<Eigen::Array3d>& gains) const;
  /// How much brighter each camera shows a texel than all do, a channel each; their geometric mean is 1. Cameras that share too
  /// few texels with others have 1.
  std::vector<Eigen::Array3d> Gains() const;
  /// Share of the surface's texels that some view saw.
  double SeenShare() const;

 private:
  struct Sample {
    float weight = 0;
    int camera_idx = 0;
    std::array<uint8_t, 3> colour{};
  };
  /// The mean about the median of a texel's samples, each divided by its camera's gains; false: nobody saw it.
  bool ColourOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const;
  /// Their weighted median.
  bool MedianOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const;
  using ColourRule = bool (TextureBaker::*)(size_t, const std::vector<Eigen::Array3d>&, Eigen::Array3d*) const;
  Textures FinishBy(ColourRule rule, const std::vector<Eigen::Array3d>& gains) const;
  std::vector<Eigen::Array3d> RelativeGains(const std::vector<Eigen::Array3d>& gains) const;
  void AddTexel(const ViewSampler& sampler, int camera_idx, size_t texel);

  const BodyTemplate& body_;
  TexelMap map_;
  int num_cameras_ = 0, num_samples_ = 0;
  std::vector<Sample> samples_;  // (24, S, S, num_samples)
};

/// Textured body as a camera sees it, on black: colour and coverage are means over 4 x 4 samples a pixel.
struct RenderedBody {
  Image image;  ///< (H, W, 3), premultiplied
  Image cover;  ///< (H, W, 1)
};
RenderedBody RenderBody(const BodyTemplate& body, const Textures& textures, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera);

}  // namespace mvstudio::body
