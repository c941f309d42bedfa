#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/image.h"

/// The one reader of masks: whatever a file's numbers are, 255 is the person afterwards, 0 the background.
namespace mvstudio::dataset {

/// What the numbers of a set of masks mean. Decided once for all files of the set, so that one mask that is nearly black
/// does not mean something else than its neighbours.
struct MaskMeaning {
  enum class Form {
    kBinary,  ///< 0, and the largest number that the file can hold
    kSoft,    ///< from 0 to that number: the share of the pixel that the person covers
    kLabels,  ///< 0 is the background, every other number a part of the person
    kNobody,  ///< every pixel of every file that was looked at is 0
  };
  Form form = Form::kBinary;
  bool from_alpha = false;            ///< the opacity is the mask, the colours are not
  bool lossy_labels = false;          ///< labels in JPEG, which changes numbers along outlines
  std::vector<int> labels;            ///< of kLabels: the numbers that were seen, ascending; at most 64
  std::vector<std::string> inverted;  ///< files that show a person around the whole border, in a set where most do not
  int files = 0;                      ///< that were looked at

  /// One line to tell: "masks of 0 and 1: 1 is the person". Empty for masks of 0 and 255, and for soft ones.
  std::string Text() const;
  /// True when the meaning was guessed from a single number in the middle, or masks look inverted or say nothing.
  bool IsDoubtful() const;
};

/// Looks at up to 48 of the files, evenly chosen. Throws IoError, and FormatError that names a file, at "values": grey images
/// that are no mask, labels beside 255, files that contradict each other (0 and 1 beside 0 and 255), masks without a
/// background, and sets in which most masks are inverted. No file: kBinary.
MaskMeaning MeaningOfMasks(const std::vector<std::string>& paths);

/// (H, W, 1), 0 to 255; 0 or 255 unless the set is soft. PNG of 1 to 16 bits, with palette, colours or opacity, and JPEG.
/// Throws IoError; FormatError also for a file that contradicts `meaning`.
Image ReadMask(const std::string& path, const MaskMeaning& meaning);
/// A file that stands alone.
Image ReadMask(const std::string& path);

/// The meaning of the masks in FOLDER/*/*.png and FOLDER/*.png, decided when first needed. Copies share it. Thread-safe.
class MaskFolder {
 public:
  MaskFolder();
  const MaskMeaning& Of(const std::string& folder) const;

 private:
  struct Known;
  std::shared_ptr<Known> known_;
};

}  // namespace mvstudio::dataset
