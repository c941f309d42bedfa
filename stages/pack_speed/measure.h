#pragma once

#include <string>
#include <vector>

#include "core/progress.h"

/// Cost of reading crops of people during training: packs of several codecs and crop sizes against a folder of JPEG
/// images that are cropped when read. Used by the command and by the benchmark.
namespace mvstudio::stages {

struct PackSpeedOptions {
  std::vector<std::string> codecs{"raw", "png", "jpeg:80", "jpeg:90", "jpeg:95", "jpeg:98"};
  std::vector<int> crops{96, 128, 256, 0};  ///< px; 0: whole images
  std::vector<int> threads{1, 2};
  int frames = 12;          ///< of the dataset, evenly spaced
  int folder_quality = 95;  ///< of the JPEG folder made for comparison
  double seconds = 0.6;     ///< reading time per trial; the best third of it counts
  std::string lossless;     ///< dataset with the same images as PNG, the reference of PSNR; empty: the dataset itself
  std::string work;         ///< folder for packs and images; they are removed afterwards
};

/// One method of reading, with one number of threads.
struct PackSpeedTrial {
  bool from_folder = false;  ///< of images; else from a pack
  std::string codec;
  std::string Way() const { return from_folder ? "folder" : "pack"; }
  int crop_px = 0, threads = 1;
  double crops_per_s = 0, bytes_per_crop = 0;
  double psnr_db = 0;  ///< against the crop of the lossless image; infinity: the same bytes
  double rms_levels = 0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const PackSpeedTrial& r) {
  visit("way", r.Way());
  visit("codec", r.codec);
  visit("crop_px", r.crop_px);
  visit("threads", r.threads);
  visit("crops_per_s", r.crops_per_s);
  visit("bytes_per_crop", r.bytes_per_crop);
  visit("psnr_db", r.psnr_db);
  visit("exact", r.rms_levels == 0);
}

/// Speed of making a pack against decoding alone of the same images.
struct PackBuildSpeed {
  std::string codec;
  int crop_px = 0, threads = 1;
  double build_per_s = 0;   ///< crops per second, including digests, checks and flushes
  double decode_per_s = 0;  ///< images and masks only, with the same threads
  double decode_share = 0;  ///< fraction of the build's processor time spent decoding
};

template <class Visitor>
void VisitFields(Visitor&& visit, const PackBuildSpeed& r) {
  visit("codec", r.codec);
  visit("crop_px", r.crop_px);
  visit("threads", r.threads);
  visit("build_per_s", r.build_per_s);
  visit("decode_per_s", r.decode_per_s);
  visit("decode_share", r.decode_share);
}

/// A pack that reaches 40 dB, against such a folder.
struct PackSpeedUp {
  int crop_px = 0, threads = 1;
  std::string folder;  ///< codec of the folder
  double folder_psnr_db = 0;
  std::string codec;  ///< of the pack
  double pack_psnr_db = 0, factor = 0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, const PackSpeedUp& r) {
  visit("crop_px", r.crop_px);
  visit("threads", r.threads);
  visit("folder", r.folder);
  visit("folder_psnr_db", r.folder_psnr_db);
  visit("codec", r.codec);
  visit("pack_psnr_db", r.pack_psnr_db);
  visit("factor", r.factor);
}

struct PackSpeedReport {
  std::vector<PackSpeedTrial> trials;
  std::vector<PackBuildSpeed> builds;
  std::vector<PackSpeedUp> speed_ups;
  int images = 0, width_px = 0, height_px = 0;
};

/// Files are in the system's cache when read, so the comparison is of computation, not of disks. Throws UsageError, and
/// what reading datasets throws.
PackSpeedReport MeasurePackSpeed(const std::string& dataset, const PackSpeedOptions& options, const RunContext& run);

/// As text. `on_front`: for each trial, whether no other beats it in speed, size and PSNR at once.
std::string PackSpeedText(const PackSpeedReport& report, const std::vector<bool>& on_front);
/// The report as one page with figures and a table.
std::string PackSpeedPage(const PackSpeedReport& report, const std::vector<bool>& on_front);
/// The report as one JSON object.
std::string PackSpeedJson(const PackSpeedReport& report, const std::vector<bool>& on_front);

}  // namespace mvstudio::stages
