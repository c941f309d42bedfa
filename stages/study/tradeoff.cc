#include "stages/study/tradeoff.h"

#include <chrono>
#include <cmath>

#include "core/disk/files.h"
#include "report/page/format.h"
#include "report/page/html.h"
#include "report/svg/svg.h"

namespace mvstudio::stages {

std::vector<bool> ParetoFront(const std::vector<TradeoffPoint>& points) {
  std::vector<bool> on_front;
  for (const TradeoffPoint& a : points) {
    bool best = std::isfinite(a.cost) && std::isfinite(a.error);
    for (const TradeoffPoint& b : points) {
      best &= !(b.cost <= a.cost && b.error <= a.error && (b.cost < a.cost || b.error < a.error));
    }
    on_front.push_back(best);
  }
  return on_front;
}

std::string Shown(double value, int decimals) { return std::isfinite(value) ? report::FormatFixed(value, decimals) : "-"; }

std::unique_ptr<OutputFolder> TradeoffPlace(const std::string& folder, const std::string& command,
                                            const std::vector<std::string>& inputs) {
  if (folder.empty()) return nullptr;
  return std::make_unique<OutputFolder>(folder, inputs, std::vector<std::string>{"tradeoff-" + command + ".html"});
}

std::string WriteTradeoffPage(const TradeoffPage& page, const std::vector<TradeoffPoint>& points, const std::string& folder) {
  report::ParetoChartSpec spec;
  spec.title = page.title;
  spec.cost.label = page.cost_label;
  spec.error.label = page.error_label;
  spec.cost.log = spec.error.log = true;
  const std::vector<bool> on_front = ParetoFront(points);
  for (size_t i = 0; i < points.size(); ++i) {
    const TradeoffPoint& p = points[i];
    if (std::isfinite(p.cost) && std::isfinite(p.error)) spec.points.push_back({p.name, p.cost, p.error, on_front[i]});
  }
  const std::string path = folder + "/tradeoff-" + page.command + ".html";
  const report::Section section{
      "tradeoff", page.heading,
      report::FigureHtml(report::ParetoChart(spec), "Large dots: no other way is both cheaper and better.")};
  WriteFileAtomic(path, report::PageHtml("mvstudio tradeoff " + page.command, "", {section}, ""));
  return path;
}

double NowSeconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace mvstudio::stages
