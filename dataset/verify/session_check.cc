#include "dataset/verify/session_check.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"
#include "core/text/shell_word.h"
#include "dataset/footage/chapters.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose2d.h"
#include "dataset/session/timeline_source.h"
#include "geometry/rig/plausible.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using Findings = std::vector<Notice>;  // errors are those that fail

constexpr char kAllowOutside[] =
    "give option 'allow-outside' with every command on this session if you placed the link, or copy the footage into it";

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

std::string Where(const InspectedFootage& f) { return "take " + f.take + ", camera " + f.camera; }

/// All images of one size, as their headers tell.
void CheckHeaders(InspectedFootage* f, Findings* findings) {
  for (const std::string& file : f->info->files) {
    try {
      const ImageHeader header = ReadImageHeader(file);
      if (!(header.turn == f->info->turn)) {
        findings->push_back({"SES-ROTATED", Where(*f) + ": " + file + " is turned (EXIF) unlike the first image",
                             "write the images anew as they are to be shown", true});
      }
      if (header.width == f->info->width && header.height == f->info->height) continue;
      findings->push_back({"SES-SIZE",
                           Where(*f) + ": " + file + " is " +
                               SizeText(static_cast<int>(header.width), static_cast<int>(header.height)) +
                               ", the first image " + SizeText(f->info->width, f->info->height),
                           "", true});
    } catch (const Error& error) {
      findings->push_back({"SES-DAMAGED", Where(*f) + ": " + error.what(), "copy the image again", true});
    }
    f->sound = false;
  }
}

void InspectImages(InspectedFootage* f, bool decode, Findings* findings) {
  const FootageInfo& info = *f->info;
  f->num_frames = info.num_frames;
  f->sound = true;
  for (const auto& [first, last] : info.gaps) {
    findings->push_back(
        {"SES-GAP", Where(*f) + ": no image has the numbers " + std::to_string(first) + " to " + std::to_string(last), ""});
  }
  for (const int64_t number : info.twice) {
    f->sound = false;
    findings->push_back(
        {"SES-GAP", Where(*f) + ": two images have the number " + std::to_string(number), "leave one of them out", true});
  }
  CheckHeaders(f, findings);
  if (!decode) return;
  const auto source = OpenFrames(f->path, {true});
  while (source->Advance()) {
  }
  for (const std::string& damage : source->Damage()) {
    f->sound = false;
    findings->push_back({"SES-DAMAGED", Where(*f) + ": " + damage, "copy the image again", true});
  }
}

void InspectVideo(InspectedFootage* f, bool decode, Findings* findings) {
  const VideoTimes times = ReadVideoTimes(f->info->files);
  f->num_frames = static_cast<int64_t>(times.time_s.size());
  double low = INFINITY, high = -INFINITY;
  for (const double t : times.time_s) {
    if (std::isfinite(t)) low = std::min(low, t), high = std::max(high, t);
  }
  const double frame_s = f->info->fps_hz > 0 ? 1 / f->info->fps_hz : 0;
  f->duration_s = high >= low ? high - low + frame_s : static_cast<double>(f->num_frames) * frame_s;
  std::vector<std::string> damage;
  if (!times.cut_short.empty()) damage.push_back(times.cut_short);
  if (decode) {
    const auto source = OpenFrames(f->path, {true});
    while (source->Advance()) {
    }
    damage = source->Damage();
  }
  f->sound = damage.empty() && f->num_frames > 0;
  if (f->num_frames == 0) damage.push_back("holds no frame");
  for (const std::string& line : damage) {
    findings->push_back(
        {"SES-DAMAGED", Where(*f) + " (" + f->path + "): " + line,
         "copy the video again; mask and dataset build use what decodes with option 'keep-undamaged', pose2d always", true});
  }
}

void InspectFootage(const Session& session, const InspectOptions& options, InspectedFootage* f, Findings* findings) {
  try {
    f->path = ResolveInSession(session, f->path, options.allow_outside);
  } catch (const FormatError& error) {
    findings->push_back({"SES-OUTSIDE", Where(*f) + ": " + error.what(), kAllowOutside, true});
    return;
  } catch (const IoError& error) {
    findings->push_back({"SES-MISSING", Where(*f) + ": " + error.what(), "", true});
    return;
  }
  try {
    f->info = DescribeFootage(f->path);
    f->info->is_video ? InspectVideo(f, options.decode, findings) : InspectImages(f, options.decode, findings);
  } catch (const IoError& error) {
    findings->push_back({"SES-MISSING", Where(*f) + ": " + error.what(), "", true});
  } catch (const FormatError& error) {
    findings->push_back({"SES-DAMAGED", Where(*f) + ": " + error.what(), "", true});
  }
}

/// Sizes, rates and numbers of frames of one take.
void CompareTake(const Session& session, const std::vector<const InspectedFootage*>& take, Findings* findings) {
  std::map<double, std::vector<std::string>> rates;
  int64_t least = INT64_MAX, most = 0;
  std::string shortest;
  for (const InspectedFootage* f : take) {
    if (!f->info) continue;
    const int idx = session.FindCamera(f->camera);
    const SessionCamera* camera = idx < 0 ? nullptr : &session.cameras[static_cast<size_t>(idx)];
    if (camera && camera->width_px > 0 && (camera->width_px != f->info->width || camera->height_px != f->info->height)) {
      findings->push_back({"SES-SIZE",
                           Where(*f) + ": the footage is " + SizeText(f->info->width, f->info->height) +
                               ", mvstudio.toml says " + SizeText(camera->width_px, camera->height_px),
                           "", true});
    }
    for (const Notice& note : f->info->notes) findings->push_back({note.code, Where(*f) + ": " + note.text, note.hint});
    if (f->info->fps_hz > 0) rates[std::round(100 * f->info->fps_hz) / 100].push_back(f->camera);
    if (f->num_frames < least) least = f->num_frames, shortest = f->camera;
    most = std::max(most, f->num_frames);
  }
  if (rates.size() > 1) {
    std::string text;
    for (const auto& [rate, cameras] : rates) {
      text += (text.empty() ? "" : ", ") + cameras[0] + (cameras.size() > 1 ? " and others " : " ") + Format("%.2f", rate);
    }
    findings->push_back({"SES-RATE", "take " + take[0]->take + ": frame rates differ (" + text + ")",
                         "name time stamps or offsets, and use mvstudio session timeline"});
  }
  if (most > 0 && least < most && take.size() > 1) {
    findings->push_back({"SES-COUNT",
                         "take " + take[0]->take + ": camera " + shortest + " has " + std::to_string(least) +
                             " frames, others up to " + std::to_string(most),
                         "see mvstudio session timeline for where they are missing"});
  }
}

bool IsBoard(const Session& session, const std::string& take) {
  return std::any_of(session.takes.begin(), session.takes.end(),
                     [&](const SessionTake& other) { return other.name == take && other.kind == TakeKind::kBoard; });
}

/// Whether some take without a board has images of this camera in the calibrated size.
bool IsFilmedAt(const Session& session, const SessionReport& report, const geometry::Camera& camera) {
  return std::any_of(report.footage.begin(), report.footage.end(), [&](const InspectedFootage& f) {
    return f.camera == camera.name && f.info && f.info->width == camera.width_px && f.info->height == camera.height_px &&
           !IsBoard(session, f.take);
  });
}

/// The same camera in different sizes, and the calibration's.
void CompareSizes(const Session& session, const SessionReport& report, bool allow_outside, Findings* findings) {
  const std::string path = CalibrationOf(session, allow_outside);
  if (path.empty()) return;
  const geometry::Rig rig = ReadAnyCalibration(path);
  Append(geometry::ConflictsIn(rig), findings);
  std::set<std::string> filmed;
  for (const InspectedFootage& f : report.footage) {
    filmed.insert(f.camera);
    const int idx = rig.Find(f.camera);
    if (idx < 0 || !f.info) continue;
    const geometry::Camera& c = rig.cameras[static_cast<size_t>(idx)].camera;
    if (c.width_px == f.info->width && c.height_px == f.info->height) continue;
    if (IsBoard(session, f.take) && IsFilmedAt(session, report, c)) continue;  // the lens was resized to the people's images
    findings->push_back({"SES-SIZE",
                         Where(f) + ": the footage is " + SizeText(f.info->width, f.info->height) +
                             ", the calibration is for " + SizeText(c.width_px, c.height_px),
                         "if it shows the same part of the sensor: mvstudio calib resize " + ShellWord(path) +
                             " option 'camera-size' " + ShellWord(f.camera + "=" + SizeText(f.info->width, f.info->height)) +
                             " option 'out' resized.json, with option 'crop' for a part of it; small differences are explained "
                             "by dataset build option "
                             "'size-rule'"});
  }
  for (const SessionCamera& camera : session.cameras) {
    if (rig.Find(camera.name) >= 0) continue;
    findings->push_back({"SES-CALIB", "camera " + camera.name + " is not in the calibration " + path,
                         "calibrate it, or give it the name it has there", true});
  }
  for (const auto& camera : rig.cameras) {
    if (filmed.count(camera.camera.name)) continue;
    findings->push_back({"SES-CALIB", "camera " + camera.camera.name + " is calibrated and has no footage", ""});
  }
}

/// pose2d/TAKE/CAMERA against the footage.
void ComparePoses(const Session& session, const SessionReport& report, Findings* findings) {
  for (const SessionTake& take : session.takes) {
    const fs::path folder = TakeFolder(session, "pose2d", take.name);
    if (!fs::is_directory(folder)) continue;
    std::set<std::string> slugs;
    for (const InspectedFootage& f : report.footage) {
      if (f.take != take.name) continue;
      slugs.insert(Slug(f.camera));
      const fs::path poses = folder / Slug(f.camera);
      if (!fs::is_directory(poses)) {
        findings->push_back({"SES-POSE", Where(f) + ": has no 2D poses, other cameras have", "run mvstudio pose2d"});
        continue;
      }
      const auto count = static_cast<int64_t>(OpenPoseFrames(poses.string(), f.camera).size());
      if (f.num_frames > 0 && count != f.num_frames) {
        findings->push_back(
            {"SES-POSE",
             Where(f) + ": 2D poses of " + std::to_string(count) + " frames, footage of " + std::to_string(f.num_frames),
             "run mvstudio pose2d again"});
      }
    }
    for (const auto& entry : fs::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (!entry.is_directory() || slugs.count(name)) continue;
      findings->push_back({"SES-POSE", "take " + take.name + ": 2D poses of " + name + ", which has no footage", ""});
    }
  }
}

/// The same file under two names: by size, then by digest.
void FindSameFiles(const SessionReport& report, const RunContext& run, Findings* findings) {
  std::map<uintmax_t, std::vector<const InspectedFootage*>> by_size;
  for (const InspectedFootage& f : report.footage) {
    std::error_code error;
    const uintmax_t size = f.info && f.info->is_video ? fs::file_size(f.info->files[0], error) : 0;
    if (size > 0 && !error) by_size[size].push_back(&f);
  }
  std::vector<const InspectedFootage*> doubtful;
  for (const auto& [size, list] : by_size) {
    if (list.size() > 1) doubtful.insert(doubtful.end(), list.begin(), list.end());
  }
  std::vector<std::string> digests(doubtful.size());
  ParallelFor(static_cast<int64_t>(doubtful.size()), run.num_threads, [&](int64_t i) {
    digests[static_cast<size_t>(i)] = Sha256File(doubtful[static_cast<size_t>(i)]->info->files[0]);
  });
  std::map<std::string, const InspectedFootage*> first;
  for (size_t i = 0; i < doubtful.size(); ++i) {
    const auto [at, is_new] = first.emplace(digests[i], doubtful[i]);
    if (is_new) continue;
    findings->push_back({"SES-SAME-FILE",
                         Where(*doubtful[i]) + " is the same video as " + Where(*at->second) + " (" + at->second->path + ")",
                         "two cameras cannot have filmed the same: copy the right file", true});
  }
}

void Compare(const Session& session, const InspectOptions& options, const RunContext& run, SessionReport* report) {
  const auto guarded = [&](const char* code, const auto& check) {
    try {
      check();
    } catch (const CancelledError&) {
      throw;
    } catch (const Error& error) {
      report->findings.push_back({code, error.what(), "", true});
    }
  };
  guarded("SES-CALIB", [&] { CompareSizes(session, *report, options.allow_outside, &report->findings); });
  guarded("SES-POSE", [&] { ComparePoses(session, *report, &report->findings); });
  guarded("SES-SAME-FILE", [&] { FindSameFiles(*report, run, &report->findings); });
}

void ListCamerasWithout(const Session& session, const SessionTake& take, Findings* findings) {
  for (const SessionCamera& camera : session.cameras) {
    const bool has =
        std::any_of(take.footage.begin(), take.footage.end(), [&](const SessionFootage& f) { return f.camera == camera.name; });
    if (!has) findings->push_back({"SES-NO-FOOTAGE", "take " + take.name + ": camera " + camera.name + " has no footage", ""});
  }
}

}  // namespace

int SessionReport::num_errors() const {
  return static_cast<int>(std::count_if(findings.begin(), findings.end(), [](const Notice& f) { return f.fails; }));
}

SessionReport InspectSession(const Session& asked, const InspectOptions& options, const RunContext& run) {
  SessionReport report;
  Session session = asked;
  session.allow_outside = asked.allow_outside || options.allow_outside;
  for (const std::string& warning : session.warnings) report.findings.push_back({"SES-KEY", warning, ""});
  for (const SessionTake& take : session.takes) {
    for (const SessionFootage& f : take.footage) {
      report.footage.push_back({take.name, f.camera, f.path, std::nullopt, 0, 0, false});
    }
  }
  std::vector<Findings> findings(report.footage.size());
  ProgressStage stage(run, "looking at footage", static_cast<int64_t>(report.footage.size()));
  ParallelFor(static_cast<int64_t>(report.footage.size()), run.num_threads, [&](int64_t i) {
    InspectFootage(session, options, &report.footage[static_cast<size_t>(i)], &findings[static_cast<size_t>(i)]);
  });
  for (const Findings& list : findings) report.findings.insert(report.findings.end(), list.begin(), list.end());
  for (const SessionTake& take : session.takes) {
    std::vector<const InspectedFootage*> of_take;
    for (const InspectedFootage& f : report.footage) {
      if (f.take == take.name) of_take.push_back(&f);
    }
    ListCamerasWithout(session, take, &report.findings);
    if (!of_take.empty()) CompareTake(session, of_take, &report.findings);
  }
  if (options.compare) Compare(session, options, run, &report);
  return report;
}

}  // namespace mvstudio::dataset
