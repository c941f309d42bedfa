#include "stages/session/describe.h"

#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "stages/dataset/session_table.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

CommandResult DescribeScan(const SessionInitReport& report) {
  CommandResult result;
  for (const std::string& line : report.scanned.skipped)
    result.warnings.push_back({"SES-SKIPPED", line, "it is not part of the session"});
  for (const std::string& path : report.scanned.missing)
    result.warnings.push_back({"SES-CHAPTER", path + " is missing, though later chapters of the recording are there",
                               "copy it from the card too: the frames of a recording are counted through all its chapters"});
  for (const std::string& note : report.scanned.notes)
    result.warnings.push_back(
        {"SES-LAYOUT", note, "option 'layout' says how the folders are meant; option 'overwrite' writes the session again"});
  if (!report.unnamed.empty())
    result.warnings.push_back({"SES-CAMERA",
                               "not named in option 'cameras', but with footage, and added: " + Join(report.unnamed, ", "),
                               "leave option 'cameras' out where the names of the files and folders are the cameras'"});
  if (const size_t cameras = report.session.cameras.size(); report.expected > 0 && report.expected != cameras)
    result.warnings.push_back({"SES-CAMERA",
                               Format("the footage is of %zu cameras, option 'cameras' says %zu", cameras, report.expected),
                               "see whether all files were copied; cameras are called as their files and folders are"});
  result.metrics["layout"] = std::string(ToString(report.scanned.layout));
  return result;
}

CommandResult DescribeLink(const SessionInitReport& report) {
  const SessionInitOptions& options = report.options;
  CommandResult result;
  result.warnings.push_back(
      {"SES-OUTSIDE", report.link + " is a link to " + options.scan + ", outside the session",
       "commands on this session read it with option 'allow-outside', or once you ran: mvstudio session trust " +
           ShellWord(options.folder) + "; copy the footage in place of the link to do without"});
  return result;
}

}  // namespace

CommandResult Describe(const SessionInitReport& report) {
  const size_t cameras = report.session.cameras.size(), takes = report.session.takes.size();
  CommandResult result = DescribeScan(report);
  if (!report.link.empty()) result.Add(DescribeLink(report));
  result.outputs.push_back({report.File(), "session"});
  result.metrics["cameras"] = cameras;
  result.metrics["takes"] = takes;
  result.text = std::to_string(cameras) + " cameras, " + std::to_string(takes) + " takes\n";
  if (takes > 0) return result;
  result.text +=
      "put footage into raw/TAKE/CAMERA.mp4 and run session init again with option 'scan' raw option 'overwrite', or name it "
      "in mvstudio.toml\n";
  return result;
}

CommandResult Describe(const SessionShowReport& report) {
  CommandResult result;
  result.inputs = {report.options.folder};
  result.metrics = {{"units", report.session.units}, {"board", report.session.board}, {"cameras", ordered_json::array()}};
  for (const dataset::SessionCamera& c : report.session.cameras) {
    result.metrics["cameras"].push_back({{"name", c.name}, {"serial", c.serial}, {"lens", c.lens}});
  }
  result.metrics["footage"] = FootageJson(report.footage);
  result.text = FootageText(report.footage);
  result.Add(DescribeFootageFindings(report.footage));
  return result;
}

CommandResult Describe(const SessionTrustReport& report) {
  CommandResult result;
  result.inputs = {report.options.folder};
  result.metrics = {{"folders", report.folders}, {"file", report.file}};
  result.text = report.folders.empty() ? "reads nothing outside its folder without option 'allow-outside'\n"
                                       : "reads from now on, until it is moved: " + Join(report.folders, ", ") + "\n";
  return result;
}

CommandResult Describe(const SessionTimelineReport& report) {
  CommandResult result;
  result.inputs = report.inputs;
  for (const std::string& warning : report.unknown_keys) result.warnings.push_back({"SES-KEY", warning, ""});
  for (const std::string& note : report.made.notes) result.warnings.push_back({"SES-TIMELINE", note, ""});
  for (const dataset::CameraTimeline& c : report.made.timeline.cameras) {
    if (c.status == dataset::ClockStatus::kNoTime || c.status == dataset::ClockStatus::kNoOffset) result.exit = kExitPartial;
  }
  if (!report.unfilmed.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back({"SES-NO-FOOTAGE", "take " + report.take + " has no footage of " + Join(report.unfilmed, ", "),
                               "name it in mvstudio.toml; `mvstudio doctor` lists what is there"});
  }
  result.outputs.push_back({report.file, "timeline"});
  result.metrics = TimelineJson(report.made.timeline);
  result.text = TimelineText(report.made.timeline);
  return result;
}

}  // namespace mvstudio::stages
