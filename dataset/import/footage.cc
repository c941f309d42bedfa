#include <algorithm>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/import/import_steps.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

std::string SizeText(int64_t width, int64_t height) { return std::to_string(width) + "x" + std::to_string(height); }

void CheckSize(const geometry::Camera& camera, int64_t width, int64_t height, const std::string& path, Findings* findings) {
  if (width == camera.width_px && height == camera.height_px) return;
  findings->Warning("DAT-SIZE", path,
                    "is " + SizeText(width, height) + ", the calibration says " + SizeText(camera.width_px, camera.height_px));
}

void CopyOne(const fs::path& from, const fs::path& to) { CopyFile(from.string(), to.string()); }

void Link(const fs::path& from, const fs::path& to) {
  std::error_code error;
  MakeFolder(to.parent_path().string());
  const fs::path target = fs::canonical(from, error);
  if (error) throw IoError(from.string(), "cannot be linked: " + error.message());
  MakeSymbolicLink(target.string(), to.string());
}

std::string ImageName(const std::string& camera, int64_t frame) {
  return camera + Format("_%08lld.jpg", static_cast<long long>(frame));
}

/// Images that cannot be told to be images are left out of copies; a linked folder is taken as it is.
void ImportImages(const ImportJob& job, const geometry::Camera& camera, const PanopticFootage& footage,
                  ImportedFootage* imported, Findings* findings) {
  const fs::path from = footage.path, to = fs::path(job.work) / imported->path;
  const bool link = job.options.images == ImportImages::kLink;
  const bool hd = from.parent_path().filename() == "hdImgs";
  bool first = true;
  if (!link) MakeFolder(to.string());
  for (const auto& [number, name] : footage.images) {
    if (!link && hd && !job.range.Has(number)) continue;
    const fs::path path = from / name;
    try {
      if (!link || first) {
        const ImageHeader header = ReadImageHeader(path.string());
        if (first) CheckSize(camera, header.width, header.height, path.string(), findings);
        first = false;
      }
      if (!link) CopyOne(path, to / name), ++imported->images;
      imported->frames.push_back(number);
    } catch (const FormatError& error) {
      findings->Error("DAT-IMAGE", path.string(), WithoutPath(error));
      if (link) imported->frames.push_back(number);  // it stays in the folder
    }
  }
  if (link && !imported->frames.empty()) Link(from, to);
}

void DecodeVideo(const ImportJob& job, const geometry::Camera& camera, const PanopticFootage& footage,
                 ImportedFootage* imported, Findings* findings) {
  VideoOptions options;
  options.keep_undamaged = true;
  VideoReader reader(footage.path, options);
  CheckSize(camera, reader.info().width, reader.info().height, footage.path, findings);
  const fs::path to = fs::path(job.work) / imported->path;
  const bool hd = camera.name.compare(0, 3, "00_") == 0;
  while (reader.Advance()) {
    const auto frame = static_cast<int>(reader.frame_idx());
    if (hd && frame > job.range.last) break;
    if (hd && !job.range.Has(frame)) continue;
    WriteImage(reader.FullImage(), (to / ImageName(camera.name, frame)).string(), job.options.quality);
    imported->frames.push_back(frame);
    ++imported->images;
  }
  const VideoDamage& damage = reader.damage();
  if (damage.any()) {
    findings->Error("DAT-VIDEO", footage.path,
                    std::to_string(damage.num_missing) + " frames cannot be decoded and are left out" +
                        (damage.causes.empty() ? "" : "; " + damage.causes[0]));
  }
}

void ImportVideo(const ImportJob& job, const geometry::Camera& camera, const PanopticFootage& footage,
                 ImportedFootage* imported, Findings* findings) {
  if (job.options.images == ImportImages::kDecode) return DecodeVideo(job, camera, footage, imported, findings);
  imported->path += fs::path(footage.path).extension().string();
  const VideoInfo info = VideoReader(footage.path).info();
  CheckSize(camera, info.width, info.height, footage.path, findings);
  const VideoTimes times = ReadVideoTimes(footage.path);
  for (size_t i = 0; i < times.time_s.size(); ++i) imported->frames.push_back(static_cast<int>(i));
  if (!times.cut_short.empty()) findings->Error("DAT-VIDEO", footage.path, "is cut short: " + times.cut_short);
  const fs::path to = fs::path(job.work) / imported->path;
  if (job.options.images == ImportImages::kLink) return Link(footage.path, to);
  MakeFolder(to.parent_path().string());
  CopyOne(footage.path, to);
}

void ImportMasks(const ImportJob& job, const std::string& camera, const std::string& take) {
  const fs::path from = fs::path(job.sequence.root) / "masks" / camera;
  const fs::path to = fs::path(job.work) / "masks" / take / camera;
  std::error_code error;
  if (!fs::is_directory(from, error) ||
      (!job.options.follow_links && (fs::is_symlink(from) || fs::is_symlink(from.parent_path()))))
    return;
  if (job.options.images == ImportImages::kLink) return Link(from, to);
  MakeFolder(to.string());
  for (const std::string& path : FilesIn(from.string())) {
    const std::string stem = fs::path(path).stem().string();
    const bool named = fs::path(path).extension() == ".png" && stem.size() == camera.size() + 9 &&
                       stem.find_first_not_of("0123456789", camera.size() + 1) == std::string::npos;
    if (named && fs::is_regular_file(fs::symlink_status(path)) && job.range.Has(std::stoi(stem.substr(camera.size() + 1))))
      CopyOne(path, to / fs::path(path).filename());
  }
}

}  // namespace

ImportedFootage ImportFootage(const ImportJob& job, const geometry::RigCamera& rig_camera, const std::string& take,
                              Findings* findings) {
  const geometry::Camera& camera = rig_camera.camera;
  ImportedFootage imported;
  imported.camera = camera.name;
  const auto found = job.sequence.footage.find(camera.name);
  if (found == job.sequence.footage.end()) return imported;
  const PanopticFootage& footage = found->second;
  imported.path = "raw/" + take + "/" + camera.name;
  if (!footage.other.empty())
    findings->Warning("DAT-IMAGE", footage.other, "is left aside: " + footage.path + " is taken for this camera");
  try {
    if (footage.is_video) {
      ImportVideo(job, camera, footage, &imported, findings);
    } else {
      ImportImages(job, camera, footage, &imported, findings);
    }
  } catch (const FormatError& error) {
    findings->Error("DAT-VIDEO", error.path(), WithoutPath(error));
  }
  if (imported.frames.empty()) {
    if (!imported.path.empty()) findings->Error("DAT-IMAGE", footage.path, "gives no image of camera " + camera.name);
    imported.path.clear();
    return imported;
  }
  ImportMasks(job, camera.name, take);
  return imported;
}

}  // namespace mvstudio::dataset::internal
