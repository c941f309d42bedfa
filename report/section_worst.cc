#include <algorithm>
#include <cmath>
#include <map>

#include "core/join.h"
#include "report/page/format.h"
#include "report/scene/scene.h"
#include "report/sections.h"

/// The time steps at which a take is worst, and what is wrong there.
namespace mvstudio::report {
namespace {

constexpr size_t kMostSpans = 480;

std::string FrameLink(int64_t frame) {
  const std::string number = std::to_string(frame);
  return "<a href=\"#frame=" + number + "\">frame " + number + "</a>";
}

/// "RWrist 9.2 px, 2 cameras" of the joint with the largest residual.
std::string WorstJoint(const ScenePeople& people, size_t step) {
  const SceneJoint* worst = nullptr;
  std::string name;
  for (size_t p = 0; p < people.people.size(); ++p) {
    for (size_t j = 0; j < people.joints.size(); ++j) {
      const SceneJoint& joint = people.At(step, p, j);
      if (!std::isfinite(joint.rms_px) || (worst && joint.rms_px <= worst->rms_px)) continue;
      worst = &joint;
      name = people.joints[j] + (people.people.size() > 1 ? " of person " + std::to_string(people.people[p]) : "");
    }
  }
  if (!worst) return "";
  return "; worst " + name + ", " + FormatWithUnit(worst->rms_px, "px", 3) + " by " + std::to_string(worst->num_views) +
         (worst->num_views == 1 ? " camera" : " cameras");
}

std::string LargestResiduals(const ScenePeople& people, std::vector<SceneSpan> spans, size_t most) {
  spans.erase(std::remove_if(spans.begin(), spans.end(), [](const SceneSpan& s) { return !std::isfinite(s.rms_px); }),
              spans.end());
  std::stable_sort(spans.begin(), spans.end(), [](const SceneSpan& a, const SceneSpan& b) { return a.rms_px > b.rms_px; });
  std::string links;
  for (size_t i = 0; i < std::min(most, spans.size()); ++i) {
    links += (i > 0 ? ", " : "") + FrameLink(people.frames[spans[i].worst]) + " (" +
             EscapeHtml(FormatWithUnit(spans[i].rms_px, "px", 3) + WorstJoint(people, spans[i].worst)) + ")";
  }
  return links;
}

/// Reasons of a frame for joints without a position, with their counts.
using Reasons = std::map<std::string, int>;

/// "TooFewViews" -> "too few views"
std::string WordsOfStatus(const std::string& status) {
  std::string words;
  for (const char c : status) {
    const bool upper = std::isupper(static_cast<unsigned char>(c)) != 0;
    if (upper && !words.empty()) words += ' ';
    words += upper ? static_cast<char>(std::tolower(static_cast<unsigned char>(c))) : c;
  }
  return words;
}

std::map<int64_t, Reasons> LostJoints(const TableFile& table) {
  std::map<int64_t, Reasons> lost;
  const int frame = table.Column("frame"), status = table.Column("status");
  if (frame < 0 || status < 0) return lost;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    const double number = table.Number(row, frame);
    if (std::abs(number) < 1e15 && table.rows[row][status] != "Ok")
      ++lost[static_cast<int64_t>(number)][table.rows[row][status]];
  }
  return lost;
}

std::string MostMissing(const TableFile& table, size_t most) {
  const std::map<int64_t, Reasons> lost = LostJoints(table);
  std::vector<std::pair<int, int64_t>> worst;  // joints lost, frame
  for (const auto& [frame, reasons] : lost) {
    int count = 0;
    for (const auto& [reason, times] : reasons) count += times;
    worst.emplace_back(count, frame);
  }
  std::stable_sort(worst.begin(), worst.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::string links;
  for (size_t i = 0; i < std::min(most, worst.size()); ++i) {
    const std::string reasons = Join(lost.at(worst[i].second), ", ", [](const auto& reason) {
      return std::to_string(reason.second) + " " + WordsOfStatus(reason.first);
    });
    links += (i > 0 ? ", " : "") + FrameLink(worst[i].second) + " (" + EscapeHtml(reasons) + ")";
  }
  return links;
}

}  // namespace

WorstTimeSteps FindWorstTimeSteps(const ScenePeople& people, const TableFile& table, size_t most) {
  return {LargestResiduals(people, SpansOf(people, kMostSpans), most), MostMissing(table, most)};
}

}  // namespace mvstudio::report
