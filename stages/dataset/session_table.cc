#include "stages/dataset/session_table.h"

#include <algorithm>

#include "core/format.h"

namespace mvstudio::stages {
namespace {

using dataset::CameraTimeline;
using dataset::InspectedFootage;
using nlohmann::ordered_json;

ordered_json RangesJson(const std::vector<std::pair<int64_t, int64_t>>& ranges) {
  ordered_json json = ordered_json::array();
  for (const auto& [first, last] : ranges) json.push_back({first, last});
  return json;
}

int64_t Dropped(const CameraTimeline& c) {
  int64_t count = 0;
  for (const dataset::DroppedFrames& d : c.dropped) count += d.count;
  return count;
}

int64_t WithFrame(const CameraTimeline& c) {
  return std::count_if(c.frame_at.begin(), c.frame_at.end(), [](int64_t frame) { return frame >= 0; });
}

}  // namespace

ordered_json FootageJson(const dataset::SessionReport& report) {
  ordered_json list = ordered_json::array();
  for (const InspectedFootage& f : report.footage) {
    ordered_json entry{{"take", f.take}, {"camera", f.camera}, {"path", f.path}, {"sound", f.sound}};
    if (f.info) {
      entry["video"] = f.info->is_video;
      entry["codec"] = f.info->codec;
      entry["bits"] = f.info->bits;
      entry["width"] = f.info->width;
      entry["height"] = f.info->height;
      entry["mirrored"] = f.info->turn.mirrored;
      entry["rotation_clockwise_deg"] = 90 * f.info->turn.quarter_turns_clockwise;
      entry["fps_hz"] = f.info->fps_hz > 0 ? FiniteOrNull(f.info->fps_hz) : ordered_json(nullptr);
      entry["frames"] = f.num_frames;
      entry["duration_s"] = f.info->is_video ? FiniteOrNull(f.duration_s) : ordered_json(nullptr);
      if (!f.info->gaps.empty()) entry["gaps"] = RangesJson(f.info->gaps);
    }
    list.push_back(entry);
  }
  return list;
}

std::string FootageText(const dataset::SessionReport& report) {
  std::string text = Format("%-12s %-14s %-8s %-11s %5s %8s %7s %9s  %s\n", "take", "camera", "codec", "size", "bits", "fps",
                            "frames", "seconds", "footage");
  for (const InspectedFootage& f : report.footage) {
    text += Format("%-12s %-14s ", f.take.c_str(), f.camera.c_str());
    if (!f.info) {
      text += "cannot be read: " + f.path + "\n";
      continue;
    }
    const std::string size = std::to_string(f.info->width) + "x" + std::to_string(f.info->height);
    text += Format("%-8s %-11s %5d ", f.info->codec.c_str(), size.c_str(), f.info->bits);
    text += f.info->fps_hz > 0 ? Format("%8.3f ", f.info->fps_hz) : Format("%8s ", "-");
    text += Format("%7lld ", static_cast<long long>(f.num_frames));
    text += (f.info->is_video ? Format("%9.2f  ", f.duration_s) : Format("%9s  ", "-")) + f.path;
    text += std::string(f.sound ? "" : "  (damaged)") + "\n";
  }
  return text;
}

CommandResult DescribeFootageFindings(const dataset::SessionReport& report) {
  CommandResult result;
  int outside = 0;  // they have one cause: the link to the footage, or paths that lead out
  for (const Notice& f : report.findings) {
    if (f.code == "SES-OUTSIDE" && ++outside > 1) continue;
    (f.fails ? result.errors : result.warnings).push_back({f.code, f.text, f.hint});
  }
  for (Notice& error : result.errors) {
    if (error.code == "SES-OUTSIDE" && outside > 1) error.text += Format(" (and %d others like it)", outside - 1);
  }
  if (report.num_errors() == 0) return result;
  const bool any = std::any_of(report.footage.begin(), report.footage.end(), [](const InspectedFootage& f) { return f.sound; });
  result.exit = any ? kExitPartial : kExitBadInput;
  return result;
}

ordered_json TimelineJson(const dataset::Timeline& timeline) {
  ordered_json json{{"take", timeline.take}, {"reference", timeline.reference}, {"clock", dataset::ToString(timeline.clock)}};
  json["fps_hz"] = FiniteOrNull(timeline.fps_hz);
  json["instants"] = timeline.num_time_steps;
  json["cameras"] = ordered_json::array();
  for (const CameraTimeline& c : timeline.cameras) {
    json["cameras"].push_back({{"name", c.name},
                               {"status", ToString(c.status)},
                               {"frames", c.num_frames},
                               {"fps_hz", FiniteOrNull(c.fps_hz)},
                               {"instants_with_frame", WithFrame(c)},
                               {"dropped", Dropped(c)},
                               {"doubled", c.doubled.size()},
                               {"bad_times", c.bad_times.size()},
                               {"offset_frames", FiniteOrNull(c.offset_frames)},
                               {"sigma_frames", FiniteOrNull(c.sigma_frames)},
                               {"rate_ppm", FiniteOrNull(c.rate_ppm)},
                               {"rate_sigma_ppm", FiniteOrNull(c.rate_sigma_ppm)},
                               {"jitter_ms", FiniteOrNull(c.jitter_ms)},
                               {"residual_median_ms", FiniteOrNull(c.residual_median_ms)},
                               {"residual_max_ms", FiniteOrNull(c.residual_max_ms)}});
  }
  return json;
}

std::string TimelineText(const dataset::Timeline& timeline) {
  std::string text = Format("take %s: %lld time steps at %.4f Hz, counted by camera %s, clocks related by: %s\n",
                            timeline.take.c_str(), static_cast<long long>(timeline.num_time_steps), timeline.fps_hz,
                            timeline.reference.c_str(), dataset::ToString(timeline.clock).c_str());
  text += Format("%-14s %-9s %7s %9s %8s %8s %8s %10s %9s %10s\n", "camera", "status", "frames", "steps", "dropped", "doubled",
                 "fps", "offset", "ppm", "off by ms");
  for (const CameraTimeline& c : timeline.cameras) {
    text += Format("%-14s %-9s %7lld %9lld %8lld %8zu %8.3f %+10.3f %+9.2f %5.2f/%.2f\n", c.name.c_str(),
                   std::string(ToString(c.status)).c_str(), static_cast<long long>(c.num_frames),
                   static_cast<long long>(WithFrame(c)), static_cast<long long>(Dropped(c)), c.doubled.size(), c.fps_hz,
                   c.offset_frames, c.rate_ppm, c.residual_median_ms, c.residual_max_ms);
  }
  return text;
}

}  // namespace mvstudio::stages
