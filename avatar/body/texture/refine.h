#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "avatar/body/texture/view_sampler.h"
#include "core/progress.h"

namespace mvstudio::body {

struct RefineOptions {
  int steps = 200;
  double rate = 0.02;  ///< of Adam at the start, in colours of [0, 1]; falls to a tenth along a cosine
  /// Weights of two squares that settle what pixels leave open, where texels are finer than they are: of each texel's change,
  /// and of the differences of neighbours' changes; a texel's as much as a pixel's loss.
  double towards_start = 0.02, smooth = 2;
};

struct RefineReport {
  int64_t pixels = 0;                      ///< that the texture is held against
  double loss_before = 0, loss_after = 0;  ///< mean absolute difference, grey levels; NaN without pixels
};

/// Charts whose bilinear rendering matches images (Zhao et al., "High-Fidelity Human Avatars from a Single RGB Camera", CVPR
/// 2022, section 3.2.2). A pixel's colour is the mean of 2 x 2 places in it. Pixels count that lie wholly on the body, inside
/// the mask and not at an edge of depth.
class TextureRefiner {
 public:
  TextureRefiner(const BodyTemplate& body, int size_px);

  /// Adds the pixels of an image, whose gains are taken out. A body that is not finite has none.
  void Add(const TextureView& view);
  int64_t num_pixels() const { return static_cast<int64_t>(target_.size()); }

  /// Texels (24, S, S) of one channel in [0, 1] -> the sum over the pixels of sqrt(difference^2 + delta^2), a smooth absolute
  /// value with delta = 0.5 / 255; `gradient` (24, S, S) gets its derivatives.
  double Loss(int channel, const std::vector<float>& texels, std::vector<float>* gradient) const;

  /// Minimises the loss plus both squares from `start` by Adam (Kingma and Ba, 2015). Texels in no pixel follow their
  /// neighbours as far as `smooth` carries them; with 0 they keep their colours. `start`: square charts of this size.
  Textures Refine(const Textures& start, const RefineOptions& options, const RunContext& run, RefineReport* report) const;

 private:
  static constexpr int kFiner = 2;
  /// A place between four texels.
  struct Place {
    uint32_t texel = 0;  // its upper left one in (24, S, S)
    float right = 0, down = 0;
  };
  using Places = std::array<Place, kFiner * kFiner>;
  Place PlaceOf(const PartUvMap& map, size_t at) const;
  std::vector<float> RefineChannel(int channel, const Textures& start, const RefineOptions& options) const;
  double MeanDifference(const Textures& textures) const;

  const BodyTemplate& body_;
  int size_px_;
  std::vector<Places> places_;                  // (N)
  std::vector<std::array<uint8_t, 3>> target_;  // (N)
};

/// Charts of another size: means over footprints where they get smaller, bilinear where they grow.
Textures ResizedTextures(const Textures& textures, int size_px);

}  // namespace mvstudio::body
