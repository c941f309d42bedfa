#pragma once

#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/body/texture/bake.h"
#include "avatar/body/texture/refine.h"
#include "avatar/body/texture/view_choice.h"
#include "core/progress.h"
#include "stages/nets/texture/texture_source.h"
#include "stages/result.h"

/// The colours of a fitted body, made anew.
namespace mvstudio::stages {

enum class TextureMethod {
  kAverage,   ///< mean about the median, as `avatar fit` makes it
  kMedian,    ///< weighted median of each texel
  kGraphCut,  ///< one image a face
  kRefine,    ///< charts whose rendering matches the images
};
/// What a texture is refined by.
enum class TextureFrom {
  kImages,   ///< training images
  kRenders,  ///< a turn about the body at rest, rendered by a trained run
};
std::string_view ToString(TextureMethod method);  ///< "average", "median", "graph-cut", "refine"
std::string_view ToString(TextureFrom from);      ///< "images", "renders"
void FromString(const std::string& text, TextureMethod* method);
void FromString(const std::string& text, TextureFrom* from);

struct TextureOptions {
  std::string dataset;
  TextureMethod method = TextureMethod::kAverage;
  TextureFrom from = TextureFrom::kImages;
  double sharpen = 0;
  int size_px = 0;
  int max_px = 512;
  int max_images = 150;
  int views = 90;
  int render_px = 0;
  int steps = 200;
  double seam_price = 0.3;
  bool level_seams = true;
};

template <class Visitor>
void VisitFields(Visitor&& visit, TextureOptions& o) {
  visit("dataset", o.dataset, "dataset folder; of a run, when it is no longer where the training found it");
  visit(
      "method", o.method,
      "average: the mean about the median, as `avatar fit` takes it; median: the weighted median of each texel; graph-cut: one "
      "image for each face, with few seams; refine: a texture whose rendering matches the images");
  visit(
      "from", o.from,
      "what option 'method' refine matches: images (those of training), or renders of the run over a turn of the body at rest");
  visit("sharpen", o.sharpen, "unsharp masking of what is matched, 0 to 3: 0.75 is little, 3 is much");
  visit("size", o.size_px, "edge of each of the 24 charts, px; 0: as the body has them");
  visit("max-px", o.max_px, "longest edge of the person in the images");
  visit("max-images", o.max_images, "images used, of time steps spread evenly; graph-cut takes a quarter of them");
  visit("views", o.views, "images of the turn, for option 'from' renders");
  visit("render-size", o.render_px, "edge of its images, px; 0: as in training");
  visit("steps", o.steps, "of the refinement");
  visit("seam-price", o.seam_price,
        "of graph-cut: mm^2 of surface in the worst image that a mm of seam is worth, for each grey level by which the images "
        "differ there");
  visit("level-seams", o.level_seams, "of graph-cut: make images agree where they meet");
}

/// Scores of the textured body on validation images, which no method sees.
struct TextureScore {
  int images = 0;
  double psnr_db = std::nan(""),
         ssim = std::nan("");  ///< mean over the images: PSNR of the pixels of the mask, SSIM of its box; NaN without images
};

struct TextureResult {
  body::Textures textures;
  int images = 0;                               ///< that were used
  double seen_share = 0;                        ///< of the texels that some image showed; NaN for renders
  std::map<std::string, Eigen::Array3d> gains;  ///< red, green, blue, by camera; taken out of the colours
  std::optional<body::ViewChoice> choice;       ///< of graph-cut
  std::optional<body::RefineReport> refinement;
  TextureScore before, after;  ///< with the body's own textures, with these
};

/// Only cameras and frames of the source are looked at; validation images of its split, if it has some, score. Throws
/// UsageError for options that contradict each other.
TextureResult MakeTexture(const TextureSource& source, const TextureOptions& options, const RunContext& run);

nlohmann::ordered_json ToJson(const TextureResult& result);
std::string ToTable(const TextureResult& result);

}  // namespace mvstudio::stages
