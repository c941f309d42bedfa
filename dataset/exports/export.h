#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/fields.h"
#include "core/notice.h"
#include "core/progress.h"
#include "dataset/markers/marker_files.h"
#include "dataset/panoptic/missing.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/split.h"
#include "dataset/views/undistort.h"
#include "geometry/rig/rig.h"

/// Exports a dataset to formats of other programs. docs/exports.md describes their content and interpretation.
namespace mvstudio::exports {

enum class ExportImages {
  kLink,  ///< hard links; copies where the file system has none
  kCopy,
  kNone,  ///< cameras and joints only
};
/// Which images are resampled to an ideal pinhole.
enum class ExportUndistort {
  kAuto,  ///< those of lenses that the format cannot describe
  kAlways,
  kNever,  ///< such lenses are refused
};
/// What cameras are called.
enum class ExportNames {
  kDataset,  ///< 00_07
  kStudio,   ///< the name in the calibration, made safe
};
/// Where the masks go.
enum class ExportMasks {
  kFolder,  ///< files of their own, as the format has them
  kAlpha,   ///< the alpha channel of PNG images, which are black outside; no files
  kNone,
};
std::string_view ToString(ExportImages images);        ///< "link", "copy", "none"
std::string_view ToString(ExportUndistort undistort);  ///< "auto", "always", "never"
std::string_view ToString(ExportNames names);          ///< "dataset", "studio"
std::string_view ToString(ExportMasks masks);          ///< "folder", "alpha", "none"
/// Throw UsageError.
void FromString(const std::string& text, ExportImages* images);
void FromString(const std::string& text, ExportUndistort* undistort);
void FromString(const std::string& text, ExportNames* names);
void FromString(const std::string& text, ExportMasks* masks);

struct ExportOptions {
  ExportImages images = ExportImages::kCopy;
  ExportUndistort undistort = ExportUndistort::kAuto;
  dataset::UndistortView undistort_view = dataset::UndistortView::kInside;
  ExportMasks masks = ExportMasks::kFolder;
  ExportNames names = ExportNames::kDataset;
  int jpeg_quality = 95;
  double frame_rate_hz = 0;
  markers::TrcUnit trc_unit = markers::TrcUnit::kMillimetre;
  int hull_points = 20000;
  std::string scale_folder = "1x";
  bool overwrite = false;
  std::string split;                 ///< file of dataset/views/split.h; may be empty
  std::vector<std::string> cameras;  ///< names of either kind; empty: all
  std::vector<int> frames;           ///< empty: the first one for formats of one time step, else all
  bool all_frames = false;           ///< all frames also for formats of one time step
};

template <class Visitor>
void VisitFields(Visitor&& visit, ExportOptions& o) {
  visit("pictures", o.images,
        "link: hard links, no space is taken (copies where the file system cannot); copy; none: cameras and joints only");
  visit("masks", o.masks,
        "folder: files of their own; alpha: the alpha channel of PNG images that are black outside (colmap, nerfstudio); none");
  visit("undistort", o.undistort,
        "auto: images of lenses that the format cannot describe are resampled to an ideal pinhole; always; never: such lenses "
        "are refused");
  visit("undistort-view", o.undistort_view,
        "inside: the largest view without black borders; all: every pixel of the footage; keep: the lens's own focal lengths; "
        "centred: the largest one with the principal point in the middle, as Gaussian splatting's loader assumes it");
  visit("names", o.names, "names of the cameras: dataset (00_07) or studio (the name in the calibration, made safe)");
  visit("jpeg-quality", o.jpeg_quality, "0..100, of images that are resampled or change their format");
  visit("frame-rate", o.frame_rate_hz, "Hz; frame rate of joint files; 0: from the dataset's time stamps");
  visit("trc-unit", o.trc_unit, "trc: unit of its lengths, mm or m");
  visit("hull-points", o.hull_points, "points of the silhouettes' hull at most, for formats that start from points; 0: none");
  visit("scale-folder", o.scale_folder, "actorshq: name of the folder with the images (1x, 2x, 4x)");
  visit("overwrite", o.overwrite, "replace the output folder");
}

struct ExportedCamera {
  std::string name;                                         ///< in the export
  std::string source;                                       ///< in the dataset, 00_NN
  std::string studio;                                       ///< in the calibration; may be empty
  dataset::PartOfSplit part = dataset::PartOfSplit::kNone;  ///< none without a split
  bool undistorted = false;
  double lost_share = 0;  ///< fraction of the footage's pixels that the ideal pinhole does not show
};

struct ExportReport {
  std::string format;
  std::vector<ExportedCamera> cameras;
  std::vector<int> frames;
  int people = 0;  ///< different ids
  int images = 0, masks = 0;
  int points = 0;  ///< 3D points to start a reconstruction from, of all frames
  int missing_images = 0, missing_masks = 0;
  dataset::MissingImages missing;                       ///< the same by camera of the dataset
  int linked = 0;                                       ///< of the images and masks, those that use no disk space
  std::vector<std::string> files;                       ///< relative to the folder; without images and masks
  std::vector<std::pair<std::string, double>> figures;  ///< measured while writing: "bvh_rms_mm", "max_rounding_mm", …
  std::vector<Notice> notes;
};

/// Lens model that a format requires.
enum class LensNeed { kAny, kBrown5, kBrown4, kPinhole };

struct FormatInfo {
  std::string name, what;
  LensNeed lens = LensNeed::kAny;
  bool one_time_step = false;  ///< describes a single frame; several frames become one folder each
  bool one_size = false;       ///< all images have the same size
  bool has_images = false;
  bool rig_only = false;   ///< can be written from a calibration alone (WriteRig)
  bool has_alpha = false;  ///< its readers take masks from an alpha channel
  /// Ending of the one file that holds the cameras alone, and of the one that holds a dataset; empty: there are several.
  std::string rig_file = {}, one_file = {};
};
const std::vector<FormatInfo>& Formats();
/// Throws UsageError that lists the names.
const FormatInfo& FormatByName(const std::string& name);

/// Whether `path` is the name of the one file that a format writes: it ends as that does, and no folder is there.
bool IsRigFile(const FormatInfo& format, const std::string& path);
bool IsDatasetFile(const FormatInfo& format, const std::string& path);

/// Writes the folder `out`, completely or not at all, with `export.json` beside the format's own files; or the format's one
/// file alone, where `out` is its name. Throws UsageError
/// for options and lenses that do not fit the format, FormatError / IoError for damaged images and when the dataset has
/// none of the images, ResourceError. Some that it does not have are counted and left out.
ExportReport ExportDataset(const dataset::PanopticDataset& dataset, const std::string& format, const std::string& out,
                           const ExportOptions& options, const RunContext& run = {});

/// Writes only the cameras, for formats with `rig_only`, to a file or a folder, depending on `path`. Names are made safe;
/// the report lists the changes. Throws FormatError naming a camera whose lens the format cannot describe.
ExportReport WriteRig(const geometry::Rig& rig, const std::string& format, const std::string& path);

}  // namespace mvstudio::exports
