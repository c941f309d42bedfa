#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/progress.h"
#include "dataset/exports/take.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::exports {

/// Copies images and masks of a take to the export's folder. They are listed first and made by `Run`, in parallel.
class Images {
 public:
  Images(const Take& take, const ExportOptions& options, std::string folder);
  ~Images();

  enum class MaskValues { k255, k1 };

  /// Lists an image; `stem` is relative to the folder, without extension. Returns the file's relative path, or "" when
  /// the dataset has no such image (counted). With `extension` (".jpg" or ".png") the image is converted if it
  /// differs. With masks as alpha it is a PNG of four channels: 0 0 0 0 where the mask is 0, opaque without a mask.
  std::string AddImage(size_t view, int frame, const std::string& stem, const std::string& extension = "");
  /// `path` is relative, with ".png". Foreground is 255, or 1 for readers that use the values directly. Lists nothing unless
  /// masks go into files.
  bool AddMask(size_t view, int frame, const std::string& path, MaskValues values = MaskValues::k255);
  /// The mask that was listed last also goes to this path: readers of one layout look in different folders.
  void AlsoTo(const std::string& path);

  /// The image or mask as exported, for colours; empty when there is none.
  Image LoadImage(size_t view, int frame) const;
  Image LoadMask(size_t view, int frame) const;
  Image LoadWithAlpha(size_t view, int frame) const;
  /// Bytes of the encoded image or mask, for containers; empty when there is none (counted).
  std::string EncodedImage(size_t view, int frame);
  std::string EncodedMask(size_t view, int frame);

  /// Throws FormatError when all images that were asked for so far are missing. To be asked before a file is published.
  void RequireAny() const;

  /// Makes everything that was listed. Throws FormatError for an image whose size differs from its camera's, IoError,
  /// ResourceError.
  void Run(const RunContext& run, ExportReport* report);

 private:
  struct Task;
  struct Resampling;
  std::string SourceOf(size_t view, int frame, bool mask) const;
  bool IsPlain(const std::string& mask) const;
  bool Make(const Task& task) const;
  void CountImage(size_t view, int frame, bool is_missing);
  void CountMissingMask(size_t view, int frame);

  const Take& take_;
  const ExportOptions& options_;
  const std::string folder_;
  dataset::PanopticDataset dataset_;  ///< names of files
  std::vector<Task> tasks_;
  std::unique_ptr<Resampling> resampling_;
  dataset::MissingImages missing_;
  int missing_images_ = 0, missing_masks_ = 0, contained_images_ = 0, contained_masks_ = 0;
};

}  // namespace mvstudio::exports
