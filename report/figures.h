#pragma once

#include <string>
#include <vector>

#include "report/page/value.h"

/// The numbers of results that tell most, for cards and for comparisons of runs.
namespace mvstudio::report {

/// Which of two values of a figure is the better one.
enum class Better { kLess, kMore, kNeither };

struct Figure {
  const char* command;            ///< "avatar eval"
  const char* list;               ///< key of a list with an entry for each camera; "": of the whole result
  const char* label;              ///< "held-out rms"
  std::vector<std::string> keys;  ///< dotted; the first that is a number counts
  const char* unit;
  Better better = Better::kNeither;
  double scale = 1;          ///< of the number, to be in the unit
  const char* sigma = "";    ///< key of its standard deviation; a pair `KEY_ci95` is looked for anyway
  bool on_card = false;      ///< shown on the card of its result
  bool main = false;         ///< decides whether a result as a whole is better than another
  bool of_held_out = false;  ///< a score of held-out images: compared only where both runs have the same ones
  bool of_machine = false;   ///< time and memory
};

const std::vector<Figure>& Figures();

/// Of the metrics of a result, or of an entry of its list; NaN where there is none.
double FigureNumber(const Figure& figure, const Value& of);

/// Half the 95 % interval of the same number, in the figure's unit; NaN where nothing states it.
double FigureHalfWidth(const Figure& figure, const Value& of);

}  // namespace mvstudio::report
