#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "avatar/body/texture/view_sampler.h"
#include "core/progress.h"

/// A texture in which every face takes one image.
namespace mvstudio::body {

struct ViewChoiceOptions {
  /// Price of a seam, per mm and grey level that the two images differ by: in units of a square millimetre of surface that
  /// takes an image that sees it not at all.
  double seam_price = 0.3;
  int max_sweeps = 4;
  bool level_seams = true;
};

struct ViewChoice {
  std::vector<int> view_of_face;           ///< (F) index of the view; -1: none shows the whole face
  int num_views = 0;                       ///< of those that are taken somewhere
  double seam_m = 0;                       ///< length of the edges between faces of different views, on the body at rest
  int64_t energy = 0, energy_of_best = 0;  ///< of the choice, and of taking the best view of each face
};

/// Labels the faces with views (Lempitsky, Ivanov, "Seamless Mosaicing of Image-Based Texture Maps", CVPR 2007). A face's cost
/// falls with what a view shows of it: its area in the image, hence the angle of sight, near the mask's edge less. Two faces
/// with a common edge cost what their views' colours differ by along it, whether charts meet there or not. Colours must have
/// the gains of cameras taken out (WithoutGain). Views of NaN vertices show nothing.
ViewChoice ChooseViews(const BodyTemplate& body, const std::vector<TextureView>& views, const ViewChoiceOptions& options,
                       const RunContext& run);

/// Colours of the texels by the views chosen. Where faces of two views meet, additive corrections that vary smoothly over each
/// view's faces take half of their difference each, if `level_seams`. Texels that no view shows are filled (FillTexels).
Textures BakeChosenViews(const BodyTemplate& body, const std::vector<TextureView>& views, const ViewChoice& choice, int size_px,
                         bool level_seams, const RunContext& run);

}  // namespace mvstudio::body
