#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/fields.h"
#include "core/progress.h"
#include "dataset/verify/verify.h"

namespace mvstudio::dataset {

enum class ImportImages {
  kLink,  ///< the session refers to the footage where it lies
  kCopy,
  kDecode,  ///< copies images, turns videos into images
};
std::string_view ToString(ImportImages images);  ///< "link", "copy", "decode"
/// Throws UsageError.
void FromString(const std::string& text, ImportImages* images);

struct PanopticImportOptions {
  std::string cameras;
  std::string frames;
  ImportImages images = ImportImages::kLink;
  std::string take;
  int quality = 95;
  bool follow_links = false;
  bool overwrite = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, PanopticImportOptions& o) {
  visit("cameras", o.cameras,
        "hd, vga, kinect and names such as 00_03, separated by commas; empty: those with footage, all when none has any");
  visit("frames", o.frames, "joints, faces, hands and images of these HD frames only, e.g. 245-1200; empty: all");
  visit("pictures", o.images,
        "link: refer to the footage where it lies; copy: copy it; decode: copy images and turn videos into images");
  visit("take", o.take, "name of the take; empty: that of the sequence");
  visit("quality", o.quality, "JPEG quality of decoded images");
  visit("follow-links", o.follow_links, "read through symbolic links that lead out of the sequence; off refuses them");
  visit("overwrite", o.overwrite, "replace the output folder");
}

struct PanopticImportReport {
  std::string sequence;
  std::vector<std::string> takes;  ///< cameras whose clock has no relation to the HD cameras' get separate takes
  int cameras = 0, cameras_with_footage = 0;
  int frames = 0, first_frame = 0, last_frame = 0;  ///< with joints
  int most_people = 0;
  int64_t joints = 0;             ///< with a position
  int faces = 0, hands = 0;       ///< files kept
  int64_t images = 0;             ///< copied or decoded
  double worst_clock_ms = 0;      ///< largest distance of a frame's time from the clock's line
  std::vector<Finding> findings;  ///< errors: cameras and frames that were left out
};

/// Converts a Panoptic sequence to a session folder: mvstudio.toml, calib/calibration.json, pose3d/TAKE, raw/TAKE with the
/// footage, masks/TAKE where there are masks, sync/TAKE.times.csv (every frame on the universal clock). panoptic/ holds
/// calibration, faces, hands and sync tables unchanged. Joints are read one file at a time. Unreadable files are left out
/// and listed. Throws UsageError, IoError, FormatError when nothing can be imported.
PanopticImportReport ImportPanoptic(const std::string& root, const std::string& session_folder,
                                    const PanopticImportOptions& options, const RunContext& run = {});

}  // namespace mvstudio::dataset
