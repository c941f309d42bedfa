#include "stages/markers/describe.h"

#include "core/format.h"
#include "core/join.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

CommandResult DescribeMarkerPoints(const InputNotes& notes, const PointsInput& input, const std::string& folder) {
  CommandResult result;
  static_cast<InputNotes&>(result) = notes;
  result.folder = folder;
  if (!input.is_run)
    result.text = "read in " + input.unit + ", " + input.up + Format(" up, %g frames a second\n", input.pose.frame_rate_hz);
  return result;
}

ordered_json GaitJson(const GaitOfPerson& gait) {
  const markers::GaitReport& report = gait.report;
  ordered_json events = ordered_json::array();
  for (const markers::GaitEvent& event : report.events) {
    events.push_back({{"frame", event.frame},
                      {"side", event.left ? "left" : "right"},
                      {"event", std::string(ToString(event.kind))},
                      {"confidence", std::string(ToString(event.confidence))}});
  }
  ordered_json json = {{"person", gait.person}, {"events", events}};
  if (!report.note.empty()) json["note"] = report.note;
  if (report.events.empty()) {
    json["why_none"] = report.why_none;
  } else {
    json["speed_m_s"] = report.speed_m_s, json["cadence_per_min"] = report.cadence_per_min;
  }
  return json;
}

std::string GaitText(const GaitOfPerson& gait) {
  const markers::GaitReport& report = gait.report;
  if (report.events.empty()) return Format("person %d: no gait events: ", gait.person) + report.why_none + "\n";
  int strikes = 0, sure = 0;
  for (const markers::GaitEvent& event : report.events)
    strikes += event.kind == markers::GaitEventKind::kHeelStrike, sure += event.confidence == markers::GaitConfidence::kHigh;
  return Format(
             "person %d: %d heel strikes, %zu toe offs proposed, %d of them with high confidence; %.2f m/s, %.0f steps a "
             "minute",
             gait.person, strikes, report.events.size() - static_cast<size_t>(strikes), sure, report.speed_m_s,
             report.cadence_per_min) +
         (report.note.empty() ? "" : "; " + report.note) + "\n";
}

}  // namespace

CommandResult Describe(const MarkersReport& report) {
  CommandResult result = DescribeMarkerPoints(report.notes, report.input, report.options.out);
  result.Add(DescribeMarkers(report.written));
  return result;
}

CommandResult Describe(const MarkerEventsReport& report) {
  CommandResult result = DescribeMarkerPoints(report.notes, report.input, report.options.out);
  ordered_json persons = ordered_json::array();
  for (const GaitOfPerson& gait : report.persons) {
    persons.push_back(GaitJson(gait));
    result.text += GaitText(gait);
    if (!gait.file.empty()) result.outputs.push_back({gait.file, "events"});
  }
  result.metrics["gait"] = {{"persons", persons}};
  return result;
}

CommandResult Describe(const MarkerConvertReport& report) {
  const ConvertReport& written = report.written;
  const bool one_file = IsFileOfFormat(report.options.how, report.options.out);
  CommandResult result = DescribeMarkerPoints(report.notes, report.input, one_file ? "" : report.options.out);
  ordered_json persons = ordered_json::array();
  for (const ConvertReport::Person& person : written.persons) {
    if (person.bvh) {
      result.metrics["bvh"] = {
          {"rms_mm", 1000 * person.bvh->rms_m}, {"max_mm", 1000 * person.bvh->max_m}, {"held_frames", person.bvh->num_held}};
      result.text += Format("bones of one length leave %s rms, %s at worst in the .bvh\n",
                            LengthText(person.bvh->rms_m).c_str(), LengthText(person.bvh->max_m).c_str());
    }
    persons.push_back({{"person", person.person},
                       {"frames", person.num_frames},
                       {"markers", person.num_markers},
                       {"not_held", person.not_held}});
    result.text += Format("person %d: %d frames of %d points\n", person.person, person.num_frames, person.num_markers);
    if (!person.not_held.empty()) result.text += "a " + written.format + " does not hold " + Join(person.not_held, "; ") + "\n";
  }
  for (const auto& [path, role] : written.files) result.outputs.push_back({path, role});
  const double rate_hz = report.input.pose.frame_rate_hz;
  result.metrics["converted"] = {
      {"to", written.format}, {"rate_hz", rate_hz}, {"unit", written.unit}, {"up", written.up}, {"persons", persons}};
  result.text += Format("written in %s, %s up, %g frames a second\n", written.unit.c_str(), written.up.c_str(), rate_hz);
  return result;
}

}  // namespace mvstudio::stages
