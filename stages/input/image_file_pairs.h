#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "avatar/metrics/scores.h"
#include "core/image.h"
#include "core/progress.h"
#include "dataset/footage/mask_io.h"

/// Images of two folders with the same name, and their similarity. Needs no network and no libtorch.
namespace mvstudio::stages {

/// What is behind pixels with opacity, which is taken as not premultiplied.
struct Backdrop {
  std::array<uint8_t, 3> rgb = {0, 0, 0};
  std::string reason;  ///< "as asked for", or what the other images show there
};
/// "black", "white" or "R,G,B"; throws UsageError for other words.
Backdrop BackdropOf(const std::string& text);
/// "black (0, 0, 0)".
std::string ToString(const Backdrop& backdrop);
/// RGB over the backdrop; `clear` becomes true where a pixel is not opaque.
Image ReadOver(const std::string& path, const Backdrop& backdrop, bool* clear = nullptr);

struct ImageFilePair {
  std::string name = {}, reference = {}, other = {}, mask = {};  ///< paths; mask: empty without --masks
  metrics::RegionScore full = {};
  std::optional<metrics::RegionScore> bbox = {}, masked = {};  ///< with a mask
  int width = 0, height = 0;
  int64_t mask_px = 0;  ///< pixels of the mask that are the person
  bool clear = false;   ///< one of the two has opacity, and was put over the backdrop
};

struct ImageFilePairs {
  std::vector<ImageFilePair> pairs;                           ///< by name
  std::vector<std::string> only_in_reference, only_in_other;  ///< names without a partner
  dataset::MaskMeaning masks = {};
  Backdrop backdrop = {};
};

/// PNG and JPEG files of a folder by name without extension; where it has none itself, those of its sub-folders by
/// SUB/NAME. Throws IoError for a missing folder and one without images, FormatError for a name with two extensions.
std::map<std::string, std::string> ImagesIn(const std::string& folder);

/// Pairs PNG and JPEG files by name without extension; two single files are one pair. `masks`: folder of images of the
/// same names, empty for none. Throws IoError when a folder is missing, nothing matches or a mask is missing, FormatError
/// for a name with two extensions.
ImageFilePairs PairImages(const std::string& reference, const std::string& other, const std::string& masks);

/// The colour that the opaque images of a few pairs have where their partners are clear, if it is one; else black.
Backdrop BackdropOf(const std::vector<ImageFilePair>& pairs);

/// Fills the scores. Throws FormatError for unreadable images, a pair of different sizes, images smaller than SSIM's
/// window, empty masks.
void ScorePairs(ImageFilePairs* pairs, const RunContext& run);

}  // namespace mvstudio::stages
