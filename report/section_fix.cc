#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/format.h"
#include "core/join.h"
#include "core/statistics.h"
#include "report/page/format.h"
#include "report/sections.h"

/// What to fix first, and where the run is worst.
namespace mvstudio::report {
namespace {

struct NoticeText {
  std::string text, hint;
};

/// Notices of one code from all stages; the first is that of the earliest stage.
struct Finding {
  bool fails = false;
  std::string code;
  std::vector<NoticeText> notices;
  std::vector<std::string> from, cameras;
};

void AddOnce(const std::string& text, std::vector<std::string>* list) {
  if (std::find(list->begin(), list->end(), text) == list->end()) list->push_back(text);
}

std::set<std::string> KnownCameras(const RunData& data) {
  std::set<std::string> names;
  for (const Stage& stage : data.stages) {
    for (const char* key : {"cameras", "per_camera"}) {
      for (const Value& camera : stage.metrics()[key].items()) names.insert(camera["name"].Text());
    }
  }
  names.erase("");
  return names;
}

/// The names behind the word "camera": those that are known, hold a digit or end with a colon.
void AddCamerasOf(const std::string& text, const std::set<std::string>& known, std::vector<std::string>* cameras) {
  constexpr char kWord[] = "camera ", kEnds[] = " ,;:()[]{}'\"\n";
  for (size_t at = text.find(kWord); at != std::string::npos; at = text.find(kWord, at + 1)) {
    const size_t begin = at + sizeof(kWord) - 1, end = std::min(text.find_first_of(kEnds, begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    const bool named = end < text.size() && text[end] == ':';
    if (!name.empty() && (named || known.count(name) > 0 || name.find_first_of("0123456789") != std::string::npos))
      AddOnce(name, cameras);
  }
}

/// Puts notices of one code together.
class Collector {
 public:
  explicit Collector(const RunData& data) : known_(KnownCameras(data)) {}

  void Add(bool fails, const std::string& code, NoticeText notice, const std::string& from) {
    const bool alone = code.empty() || code == "CHECK";
    const auto [place, is_new] = places_.emplace(code + (alone ? "\n" + notice.text : ""), findings_.size());
    if (is_new) findings_.emplace_back();
    Finding& finding = findings_[place->second];
    finding.fails |= fails, finding.code = code;
    AddOnce(from, &finding.from);
    AddCamerasOf(notice.text, known_, &finding.cameras);
    if (seen_.emplace(code, notice.text).second) finding.notices.push_back(std::move(notice));
  }

  void AddList(const Value& list, bool error, const std::string& from) {
    for (const Value& notice : list.items()) {
      Add(error || notice["level"].Text() == "fail", notice["code"].Text(),
          {notice["text"].Text(notice.Text()), notice["hint"].Text()}, from);
    }
  }

  std::vector<Finding> FailuresFirst() {
    std::stable_sort(findings_.begin(), findings_.end(), [](const Finding& a, const Finding& b) { return a.fails > b.fails; });
    return std::move(findings_);
  }

 private:
  std::set<std::string> known_;
  std::map<std::string, size_t> places_;
  std::set<std::pair<std::string, std::string>> seen_;
  std::vector<Finding> findings_;
};

void AddMissedChecks(const Stage& stage, Collector* collector) {
  for (const Value& check : stage.metrics()["checks"].items()) {
    if (check["pass"].kind() != Value::Kind::kBool || check["pass"].Flag()) continue;
    const std::string unit = check["unit"].Text();
    collector->Add(stage.verdict == Verdict::kFail, "CHECK",
                   {check["name"].Text("?") + ": " + FormatWithUnit(check["value"].Number(), unit, 3) + ", bound " +
                        FormatWithUnit(check["bound"].Number(), unit, 3),
                    ""},
                   stage.command);
  }
}

/// Failures, then warnings, each in the order of the pipeline: what an early stage says is the reason for what follows.
std::vector<Finding> FindingsOf(const RunData& data, const std::vector<Notice>& of_sections) {
  Collector collector(data);
  for (const Stage& stage : data.stages) {
    collector.AddList(stage.result["errors"], true, stage.command);
    AddMissedChecks(stage, &collector);
    collector.AddList(stage.result["warnings"], false, stage.command);
  }
  for (const std::vector<Notice>* list : {&data.warnings, &of_sections}) {
    for (const Notice& notice : *list) collector.Add(false, notice.code, {notice.text, notice.hint}, "report");
  }
  return collector.FailuresFirst();
}

std::string HintHtml(const std::string& hint) {
  return hint.empty() ? "" : "<span class=\"hint\">\u2192 " + EscapeHtml(hint) + "</span>";
}

std::string LineOf(const Finding& finding) {
  const NoticeText& first = finding.notices.front();
  std::string origin = Join(finding.from, ", ") + (finding.code.empty() ? "" : " \u00b7 " + finding.code);
  if (!finding.cameras.empty())
    origin += (finding.cameras.size() > 1 ? " \u00b7 cameras " : " \u00b7 camera ") + Join(finding.cameras, ", ");
  std::string more;
  for (size_t i = 1; i < finding.notices.size(); ++i) {
    const NoticeText& notice = finding.notices[i];
    more += "<p>" + EscapeHtml(notice.text) + HintHtml(notice.hint == first.hint ? "" : notice.hint) + "</p>\n";
  }
  if (!more.empty()) more = DetailsHtml(std::to_string(finding.notices.size() - 1) + " more of this kind", more);
  return std::string("<li") + (finding.fails ? " class=\"fail\">" : ">") + "<strong>" + EscapeHtml(first.text) + "</strong>" +
         HintHtml(first.hint) + " <span class=\"from\">" + EscapeHtml(origin) + "</span>" + more + "</li>\n";
}

/// A score of cameras and of single frames.
struct Measure {
  const char *command, *what, *cameras, *frames, *key, *label, *unit;
  bool larger_is_better;
};
constexpr Measure kMeasures[] = {
    {"calibrate", "Calibration", "cameras", "board_views", "rms_px", "rms", "px", false},
    {"triangulate", "3D joints", "holdout.cameras", "", "median_px", "median error when left out", "px", false},
    {"avatar eval", "Avatar", "per_camera", "pictures", "ssim", "SSIM", "", true},
};

/// The worst entry of a list; null without numbers.
const Value& WorstOf(const Value& list, const Measure& measure) {
  static const Value null;
  const Value* worst = &null;
  for (const Value& entry : list.items()) {
    const double value = entry[measure.key].Number(), known = (*worst)[measure.key].Number();
    if (std::isfinite(value) && (!std::isfinite(known) || (measure.larger_is_better ? value < known : value > known)))
      worst = &entry;
  }
  return *worst;
}

std::string NumberOf(const Value& entry, const Measure& measure) {
  return std::string(", ") + measure.label + " " + FormatWithUnit(entry[measure.key].Number(), measure.unit, 3);
}

/// The name of a camera; where the studio in 3D has it, a link to it there.
std::string CameraHtml(const RunData& data, const std::string& name) {
  const auto has = [&](const Value& camera) { return camera["name"].Text() == name && camera["cam_from_world"].IsObject(); };
  if (data.calibrations.empty()) return EscapeHtml(name);
  const Value& cameras = data.calibrations.front().value["cameras"];
  if (std::none_of(cameras.items().begin(), cameras.items().end(), has)) return EscapeHtml(name);
  std::string escaped;
  for (const char c : name)
    escaped += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-'
                   ? std::string(1, c)
                   : Format("%%%02X", static_cast<unsigned char>(c));
  return "<a href=\"#camera=" + escaped + "\">" + EscapeHtml(name) + "</a>";
}

/// "Calibration: worst camera left, rms 0.41 px (median 0.22 px); worst frame 12 of left, rms 0.6 px." as a list's entry.
std::string WorstIn(const RunData& data, const Stage& stage, const Measure& measure) {
  const Value& cameras = stage.metrics().Path(measure.cameras);
  const Value &camera = WorstOf(cameras, measure), &frame = WorstOf(stage.metrics()[measure.frames], measure);
  std::vector<std::string> parts;
  if (!camera.IsNull() && cameras.items().size() > 1) {
    std::vector<double> all;
    for (const Value& entry : cameras.items()) all.push_back(entry[measure.key].Number());
    const double median = LinearQuantile(FiniteValues(all), 0.5);
    parts.push_back("worst camera " + CameraHtml(data, camera["name"].Text(camera["camera"].Text("?"))) +
                    EscapeHtml(NumberOf(camera, measure) + " (median " + FormatWithUnit(median, measure.unit, 3) + ")"));
  }
  if (frame["frame"].IsNumber()) {
    parts.push_back(EscapeHtml("worst frame " + FormatNumber(frame["frame"].Number(), 9) + " of " + frame["camera"].Text("?") +
                               NumberOf(frame, measure)));
  }
  return parts.empty() ? "" : "<li>" + EscapeHtml(measure.what) + ": " + Join(parts, "; ") + ".</li>\n";
}

/// At most 160 bytes, cut between words.
std::string Shortened(const std::string& text) {
  constexpr size_t kMost = 160;
  if (text.size() <= kMost) return text;
  size_t end = text.rfind(' ', kMost);
  if (end == std::string::npos || end == 0) {
    for (end = kMost; end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80;) --end;
  }
  return text.substr(0, end) + "\u2026";
}

}  // namespace

Verdict OverallVerdict(const RunData& data) {
  Verdict overall = Verdict::kNotRun;
  for (const Stage& stage : data.stages) overall = Worse(overall, stage.verdict);
  return data.warnings.empty() ? overall : Worse(overall, Verdict::kWarn);
}

std::string VerdictSentence(const RunData& data, bool with_reason) {
  const auto count = [&](Verdict verdict) {
    return std::count_if(data.stages.begin(), data.stages.end(), [&](const Stage& s) { return s.verdict == verdict; });
  };
  const auto all = static_cast<int64_t>(data.stages.size()), failed = count(Verdict::kFail), warned = count(Verdict::kWarn);
  const std::string of_all = " of " + std::to_string(all) + (all == 1 ? " result" : " results");
  std::string sentence;
  if (failed > 0) {
    sentence = std::to_string(failed) + of_all + " failed";
  } else if (warned > 0) {
    sentence = "Nothing failed; " + std::to_string(warned) + of_all + (warned == 1 ? " has" : " have") + " warnings";
  } else if (all > 0) {
    sentence = all == 1 ? "The one result passed" : "All " + std::to_string(all) + " results passed";
  } else {
    sentence = "No command has left a result here";
  }
  if (!with_reason) return sentence + ".";
  const std::vector<Finding> findings = FindingsOf(data, {});
  if (findings.empty()) return sentence + ".";
  const Finding& first = findings.front();
  return sentence + ". First, " + first.from.front() + ": " + Shortened(first.notices.front().text);
}

std::string WorstList(const SectionContext& context) {
  std::string items;
  for (const Measure& measure : kMeasures) {
    const std::vector<const Stage*> stages = context.data.All(measure.command);
    if (!stages.empty()) items += WorstIn(context.data, *stages.front(), measure);
  }
  if (!context.worst_step.empty()) items += "<li>Time steps: " + context.worst_step + ".</li>\n";
  return items.empty() ? "" : "<ul class=\"worst\">" + items + "</ul>\n";
}

std::string WhatToFix(const SectionContext& context) {
  const std::vector<Finding> findings = FindingsOf(context.data, context.warnings);
  constexpr size_t kShown = 12;
  std::string shown, hidden;
  for (size_t i = 0; i < findings.size(); ++i) (i < kShown ? shown : hidden) += LineOf(findings[i]);
  std::string html = "<h3>What to fix first</h3>\n";
  const bool passed = OverallVerdict(context.data) == Verdict::kPass;
  if (passed && !findings.empty()) html += ParagraphHtml("No frame failed.");
  html += findings.empty() ? ParagraphHtml(passed ? "No frame failed, no warnings." : "No warnings.")
                           : "<ol class=\"fix\">" + shown + "</ol>\n";
  if (!hidden.empty())
    html += DetailsHtml(std::to_string(findings.size() - kShown) + " more", "<ol class=\"fix\">" + hidden + "</ol>\n");
  return html;
}

}  // namespace mvstudio::report
