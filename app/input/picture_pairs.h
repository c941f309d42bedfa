#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/progress.h"
#include "metrics/scores.h"

/// Pictures of two folders with the same name, and their similarity. Needs no network and no libtorch.
namespace mvstudio::app {

struct PicturePair {
  std::string name, reference, other, mask;  ///< paths; mask: empty without --masks
  metrics::RegionScore full;
  std::optional<metrics::RegionScore> bbox, masked;  ///< with a mask
  int width = 0, height = 0;
};

struct PicturePairs {
  std::vector<PicturePair> pairs;                             ///< by name
  std::vector<std::string> only_in_reference, only_in_other;  ///< names without a partner
};

/// Pairs PNG and JPEG files by name without extension; two single files are one pair. `masks`: folder of pictures of the
/// same names, empty for none. Throws IoError when a folder is missing, nothing matches or a mask is missing, FormatError
/// for a name with two extensions.
PicturePairs PairPictures(const std::string& reference, const std::string& other, const std::string& masks);

/// Fills the scores. Throws FormatError for unreadable pictures, a pair of different sizes, pictures smaller than SSIM's
/// window, empty masks.
void ScorePairs(PicturePairs* pairs, const RunContext& run);

}  // namespace mvstudio::app
