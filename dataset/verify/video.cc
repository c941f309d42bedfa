#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "dataset/footage/video_io.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kSide = 16;

void CheckSize(const VideoInfo& info, const geometry::Camera& camera, const std::string& path, Findings* findings) {
  if (info.width == camera.width_px && info.height == camera.height_px) return;
  findings->Error("DAT-SIZE", path,
                  "is " + std::to_string(info.width) + "x" + std::to_string(info.height) + ", the calibration says " +
                      std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px));
}

/// Decodes all frames, or with a step only the first few; keeps thumbnails of frames spread over them.
void Decode(VideoReader* reader, int64_t frames, const VerifyOptions& options, FootageCheck* check) {
  const bool all = options.image_step == 1;
  const int64_t sample = all ? std::max<int64_t>(1, frames / 8) : 1;
  while (reader->Advance()) {
    const int64_t frame = reader->frame_idx();
    if (frame % sample == 0 && check->thumbnails.size() < 8) {
      check->thumbnails[static_cast<int>(frame)] = MakeThumbnail(reader->FullImage());
      if (!all && check->thumbnails.size() == 8) return;
    }
  }
}

std::vector<int> ScenesBeyond(const std::map<int, Body3dScene>& scenes, int64_t frames) {
  std::vector<int> beyond;
  for (const auto& [frame, scene] : scenes) {
    if (frame >= frames) beyond.push_back(frame);
  }
  return beyond;
}

/// The least difference of two cameras' images of the same frames, grey levels; nothing when they have none in common or the
/// images are too plain to tell.
std::optional<double> Difference(const FootageCheck& a, const FootageCheck& b) {
  double worst = 0;
  int common = 0;
  for (const auto& [frame, thumbnail] : a.thumbnails) {
    const auto other = b.thumbnails.find(frame);
    if (other == b.thumbnails.end()) continue;
    double mean = 0, spread = 0, difference = 0;
    for (const float p : thumbnail) mean += p / thumbnail.size();
    for (size_t i = 0; i < thumbnail.size(); ++i) {
      spread += std::abs(thumbnail[i] - mean) / static_cast<double>(thumbnail.size());
      difference += std::abs(thumbnail[i] - other->second[i]) / static_cast<double>(thumbnail.size());
    }
    if (spread < 3) continue;  // a dark or empty image
    ++common;
    worst = std::max(worst, difference);
    if (worst > 2) return worst;
  }
  return common > 0 ? std::optional(worst) : std::nullopt;
}

/// Numbers of frames within a kind that are not the usual one.
void CompareCounts(const std::vector<geometry::RigCamera>& cameras, const std::vector<FootageCheck>& checks,
                   const PanopticSequence& sequence, Findings* findings) {
  std::map<PanopticKind, std::map<int64_t, int>> counts;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (checks[i].frames > 0) ++counts[KindOfCamera(cameras[i].camera.name)][checks[i].frames];
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    const PanopticKind kind = KindOfCamera(cameras[i].camera.name);
    const auto& of_kind = counts[kind];
    if (checks[i].frames == 0 || of_kind.size() < 2) continue;
    const auto usual =
        std::max_element(of_kind.begin(), of_kind.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    if (checks[i].frames != usual->first) {
      findings->Warning("DAT-COUNT", sequence.footage.at(cameras[i].camera.name).path,
                        "has " + std::to_string(checks[i].frames) + " frames, other " + ToString(kind) + " cameras have " +
                            std::to_string(usual->first));
    }
  }
}

}  // namespace

Thumbnail MakeThumbnail(const Image& image) {
  Thumbnail thumbnail{};
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const int x0 = column * image.width / kSide, x1 = std::max(x0 + 1, (column + 1) * image.width / kSide);
      const int y0 = row * image.height / kSide, y1 = std::max(y0 + 1, (row + 1) * image.height / kSide);
      double sum = 0;
      for (int y = y0; y < std::min(y1, image.height); ++y) {
        for (int x = x0; x < std::min(x1, image.width); ++x) {
          for (int c = 0; c < image.channels; ++c) sum += image.Pixel(x, y)[c];
        }
      }
      thumbnail[static_cast<size_t>(row * kSide + column)] =
          static_cast<float>(sum / (double(x1 - x0) * (y1 - y0) * image.channels));
    }
  }
  return thumbnail;
}

FootageCheck VerifyVideo(const geometry::RigCamera& camera, const PanopticFootage& footage,
                         const std::map<int, Body3dScene>& scenes, const VerifyOptions& options, Findings* findings) {
  FootageCheck check;
  try {
    VideoOptions video;
    video.keep_undamaged = true;
    VideoReader reader(footage.path, video);
    const VideoTimes times = ReadVideoTimes(footage.path);
    check.frames = static_cast<int64_t>(times.time_s.size());
    CheckSize(reader.info(), camera.camera, footage.path, findings);
    if (!times.cut_short.empty()) findings->Error("DAT-VIDEO", footage.path, "is cut short: " + times.cut_short);
    Decode(&reader, check.frames, options, &check);
    const VideoDamage& damage = reader.damage();
    if (damage.any() && times.cut_short.empty()) {
      findings->Error("DAT-VIDEO", footage.path,
                      std::to_string(damage.num_missing) + " frames cannot be decoded" +
                          (damage.causes.empty() ? "" : "; " + damage.causes[0]));
    }
    ++check.videos;
  } catch (const FormatError& error) {
    findings->Error("DAT-VIDEO", footage.path, WithoutPath(error));
  } catch (const IoError& error) {
    findings->Error("DAT-VIDEO", footage.path, error.what());
  }
  const std::vector<int> beyond = ScenesBeyond(scenes, check.frames);
  if (check.frames > 0 && !beyond.empty())
    findings->Error("DAT-IMAGE-MISSING", footage.path, "ends before " + FramesText(beyond));
  return check;
}

void CompareCameras(const std::vector<geometry::RigCamera>& cameras, const std::vector<FootageCheck>& checks,
                    const PanopticSequence& sequence, Findings* findings) {
  CompareCounts(cameras, checks, sequence, findings);
  for (size_t b = 0; b < cameras.size(); ++b) {
    for (size_t a = 0; a < b; ++a) {
      if (KindOfCamera(cameras[a].camera.name) != KindOfCamera(cameras[b].camera.name)) continue;
      const auto difference = Difference(checks[a], checks[b]);
      if (!difference || *difference > 1) continue;
      findings->Error("DAT-DOUBLE", sequence.footage.at(cameras[b].camera.name).path,
                      "shows the same images as camera " + cameras[a].camera.name + ": one of the two is another camera's");
      break;
    }
  }
}

}  // namespace mvstudio::dataset::internal
