#include "stages/tradeoff/predictions.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/statistics.h"
#include "report/page/html.h"
#include "report/svg/agreement.h"
#include "stages/budget/report.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr double kSecondsBand = 0.15, kErrorBand = 0.2;

std::vector<std::string> PredictionFiles(const std::vector<std::string>& places) {
  std::vector<std::string> files;
  for (const std::string& place : places) {
    if (!std::filesystem::is_directory(place)) {
      files.push_back(place);
      continue;
    }
    std::error_code ignored;
    for (std::filesystem::recursive_directory_iterator it(place, ignored), end; it != end; it.increment(ignored)) {
      if (it->path().filename() == kPredictionsFile) files.push_back(it->path().string());
    }
  }
  std::sort(files.begin(), files.end());
  files.erase(std::unique(files.begin(), files.end()), files.end());
  if (files.empty())
    throw UsageError(std::string("no ") + kPredictionsFile + " is there: a run with option 'budget' writes one");
  return files;
}

double NumberAt(const ordered_json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : std::nan("");
}

std::string TextAt(const ordered_json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

ordered_json ObjectAt(const ordered_json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_object() ? *found : ordered_json::object();
}

KeptPrediction PredictionOf(const ordered_json& json) {
  KeptPrediction kept;
  kept.stage = TextAt(json, "stage"), kept.error_unit = TextAt(json, "error_unit");
  const ordered_json machine = ObjectAt(json, "machine"), chosen = ObjectAt(json, "chosen");
  kept.processor = TextAt(machine, "processor"), kept.load = NumberAt(machine, "load");
  kept.frames = NumberAt(ObjectAt(json, "sizes"), "frames"), kept.threads = NumberAt(json, "threads");
  for (const auto& [option, value] : chosen.items()) {
    kept.settings += (kept.settings.empty() ? "" : ", ") + option;
    if (value.is_string()) kept.settings += " " + value.get<std::string>();
  }
  kept.predicted_s = NumberAt(json, "predicted_seconds"), kept.actual_s = NumberAt(json, "actual_seconds");
  kept.trial_s = NumberAt(json, "trial_seconds");
  kept.predicted_error = NumberAt(json, "predicted_error"), kept.actual_error = NumberAt(json, "actual_error");
  return kept;
}

std::vector<KeptPrediction> ReadPredictions(const std::string& path) {
  std::vector<KeptPrediction> kept;
  const std::string text = ReadFile(path);
  int line = 0;
  for (size_t begin = 0; begin < text.size(); ++line) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string row = text.substr(begin, end - begin);
    begin = end + 1;
    if (row.empty()) continue;
    const ordered_json json = ordered_json::parse(row, nullptr, false);
    if (!json.is_object() || TextAt(json, "stage").empty())
      throw FormatError(path, "line " + std::to_string(line + 1),
                        "no prediction, an object with a stage is expected; remove the line");
    kept.push_back(PredictionOf(json));
    kept.back().path = path;
  }
  return kept;
}

StagePredictions SummaryOfStage(const std::string& stage, const std::vector<KeptPrediction>& predictions) {
  std::vector<double> seconds, errors, shares;
  for (const KeptPrediction& p : predictions) {
    if (p.stage != stage) continue;
    if (std::isfinite(p.trial_s / p.actual_s)) shares.push_back(p.trial_s / p.actual_s);
    seconds.push_back(p.actual_s / p.predicted_s), errors.push_back(p.actual_error / p.predicted_error);
  }
  return {stage, FiguresOfRatios(seconds, kSecondsBand), FiguresOfRatios(errors, kErrorBand), UpperMedian(shares)};
}

std::string PredictionsPage(const PredictionsReport& report) {
  report::AgreementChartSpec seconds{"Time of the command", "time (s)", kSecondsBand, {}};
  report::AgreementChartSpec errors{"Error on held-out data, in the unit that was asked for", "error", kErrorBand, {}};
  std::map<std::string, int> colours;
  for (const KeptPrediction& p : report.predictions) {
    const int colour = colours.emplace(p.stage, static_cast<int>(colours.size())).first->second;
    const std::string name = p.stage + (p.settings.empty() ? "" : ", " + p.settings);
    seconds.points.push_back({name, p.predicted_s, p.actual_s, colour});
    errors.points.push_back({name, p.predicted_error, p.actual_error, colour});
  }
  const auto figure = [](const report::AgreementChartSpec& spec) {
    return report::FigureHtml(
        report::AgreementChart(spec),
        Format("Dashed: %.0f %% from what was predicted. Above the line, it came out larger.", 100 * spec.band));
  };
  return report::PageHtml("mvstudio tradeoff predictions", "",
                          {{"tradeoff", "Budgets: predicted against actual", figure(seconds) + figure(errors)}}, "");
}

ordered_json RatioJson(const RatioFigures& figures) {
  return {{"num", figures.num},
          {"num_within", figures.num_within},
          {"median_ratio", FiniteOrNull(figures.median)},
          {"worst_ratio", FiniteOrNull(figures.worst)}};
}

std::string RatioText(const RatioFigures& figures) {
  return Format("%3d of %3d  %7s  %6s", figures.num_within, figures.num, Shown(figures.median, 2).c_str(),
                Shown(figures.worst, 2).c_str());
}

}  // namespace

RatioFigures FiguresOfRatios(const std::vector<double>& ratios, double band) {
  RatioFigures figures{0, 0, std::nan(""), std::nan("")};
  std::vector<double> logs;
  for (const double ratio : ratios) {
    if (!(ratio > 0) || !std::isfinite(ratio)) continue;
    logs.push_back(std::log(ratio));
    figures.num_within += std::abs(ratio - 1) <= band;
    if (std::isnan(figures.worst) || std::abs(logs.back()) > std::abs(std::log(figures.worst))) figures.worst = ratio;
  }
  figures.num = static_cast<int>(logs.size());
  if (!logs.empty()) figures.median = std::exp(UpperMedian(logs));
  return figures;
}

PredictionsReport RunPredictions(const PredictionsOptions& options) {
  PredictionsReport report;
  report.options = options;
  report.notes.inputs = PredictionFiles(options.files);
  const std::unique_ptr<OutputFolder> place = TradeoffPlace(options.out, "predictions", report.notes.inputs);
  for (const std::string& file : report.notes.inputs) {
    const std::vector<KeptPrediction> kept = ReadPredictions(file);
    if (kept.empty()) throw FormatError(file, "", "holds no prediction; a run with option 'budget' writes one");
    report.predictions.insert(report.predictions.end(), kept.begin(), kept.end());
  }
  std::map<std::string, int> names;
  for (const KeptPrediction& p : report.predictions) ++names[p.stage];
  for (const auto& [stage, count] : names) report.stages.push_back(SummaryOfStage(stage, report.predictions));
  if (options.out.empty()) return report;
  report.page = options.out + "/tradeoff-predictions.html";
  WriteFileAtomic(report.page, PredictionsPage(report));
  return report;
}

CommandResult Describe(const PredictionsReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.text = "stage         frames  predicted s  actual s  ratio  trial s   predicted error  actual error  settings\n";
  result.metrics["predictions"] = ordered_json::array();
  for (const KeptPrediction& p : report.predictions) {
    result.text +=
        Format("%-12s  %6s  %11s  %8s  %5s  %7s  %16s  %12s  %s\n", p.stage.c_str(), Shown(p.frames, 0).c_str(),
               Shown(p.predicted_s, 2).c_str(), Shown(p.actual_s, 2).c_str(), Shown(p.actual_s / p.predicted_s, 2).c_str(),
               Shown(p.trial_s, 2).c_str(), (Shown(p.predicted_error, 3) + " " + p.error_unit).c_str(),
               Shown(p.actual_error, 3).c_str(), p.settings.c_str());
    result.metrics["predictions"].push_back({{"stage", p.stage},
                                             {"file", p.path},
                                             {"settings", p.settings},
                                             {"predicted_seconds", FiniteOrNull(p.predicted_s)},
                                             {"actual_seconds", FiniteOrNull(p.actual_s)},
                                             {"trial_seconds", FiniteOrNull(p.trial_s)},
                                             {"predicted_error", FiniteOrNull(p.predicted_error)},
                                             {"actual_error", FiniteOrNull(p.actual_error)},
                                             {"error_unit", p.error_unit}});
  }
  result.text +=
      "\nstage         time within 15 %   median   worst   error within 20 %   median   worst   trial, share of the time\n";
  for (const StagePredictions& stage : report.stages) {
    result.text += Format("%-12s       %s        %s   %s %%\n", stage.stage.c_str(), RatioText(stage.seconds).c_str(),
                          RatioText(stage.error).c_str(), Shown(100 * stage.trial_share, 0).c_str());
    result.metrics["stages"][stage.stage] = {{"seconds", RatioJson(stage.seconds)},
                                             {"error", RatioJson(stage.error)},
                                             {"trial_share", FiniteOrNull(stage.trial_share)}};
  }
  if (report.page.empty()) return result;
  result.outputs.push_back({report.page, "figure"});
  result.folder = report.options.out;
  return result;
}

}  // namespace mvstudio::stages
