#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/disk/output.h"

namespace mvstudio::stages {

/// One method. NaN: it failed.
struct TradeoffPoint {
  std::string name;
  double cost = 0, error = 0;
};

/// True where no other method is at least as cheap and as good, and better in one of the two.
std::vector<bool> ParetoFront(const std::vector<TradeoffPoint>& points);

/// A figure of a text table, "-" where there is none: one byte per column, unlike the dash on pages.
std::string Shown(double value, int decimals);

struct TradeoffPage {
  std::string command;  ///< "calibrate": names the file tradeoff-calibrate.html
  std::string heading;  ///< of the section
  std::string title;    ///< of the figure
  std::string cost_label, error_label;
};

/// The right to write the page of `command` to `folder`; null when no folder is named.
std::unique_ptr<OutputFolder> TradeoffPlace(const std::string& folder, const std::string& command,
                                            const std::vector<std::string>& inputs);

/// Writes the figure to `folder` (created when missing); returns its path.
std::string WriteTradeoffPage(const TradeoffPage& page, const std::vector<TradeoffPoint>& points, const std::string& folder);

/// Of a steady clock.
double NowSeconds();

}  // namespace mvstudio::stages
