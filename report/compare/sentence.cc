#include <algorithm>
#include <cmath>

#include "core/join.h"
#include "report/compare/compared.h"
#include "report/page/format.h"

/// Whether the last run is better than the first, in sentences.
namespace mvstudio::report {
namespace {

/// What a command's result is called; the most finished first.
struct Subject {
  const char *command, *name;
  bool plural = false;
};
constexpr Subject kSubjects[] = {{"avatar eval", "avatar"},
                                 {"avatar fit", "fitted body"},
                                 {"error-budget", "error on left-out cameras"},
                                 {"triangulate", "3D joints", true},
                                 {"mask", "masks", true},
                                 {"pose2d", "2D keypoints", true},
                                 {"sync", "times of the cameras", true},
                                 {"calib eval", "calibration on new boards"},
                                 {"calibrate", "calibration"}};

using FigurePointers = std::vector<const ComparedFigure*>;

/// "SSIM 0.9125 instead of 0.9, PSNR 24.5 dB instead of 24 dB"
std::string FromTo(const FigurePointers& figures) {
  return Join(figures, ", ", [](const ComparedFigure* f) {
    return std::string(f->figure->label) + " " + FigureText(*f->figure, f->values.back()) + " instead of " +
           FigureText(*f->figure, f->values.front());
  });
}

FigurePointers With(Change change, const FigurePointers& figures) {
  FigurePointers found;
  std::copy_if(figures.begin(), figures.end(), std::back_inserter(found), [&](const auto* f) { return f->change == change; });
  return found;
}

/// Said behind figures of which no spread is known.
std::string SpreadNote(const FigurePointers& figures) {
  const bool all = std::all_of(figures.begin(), figures.end(), [](const auto* f) { return std::isfinite(f->half_width); });
  const bool none = std::none_of(figures.begin(), figures.end(), [](const auto* f) { return std::isfinite(f->half_width); });
  if (all) return figures.size() == 1 ? ", more than the spread" : ", each more than its spread";
  return none ? "; the spread is not known" : "; the spread is known of some alone";
}

/// Whose: "The avatar of `today` is better than that of `last week`".
struct Comparing {
  std::string what, of_last, than_first;
  bool plural;

  std::string Is(const std::string& how) const { return what + of_last + (plural ? " are " : " is ") + how; }
};

std::string Undecided(const Comparing& comparing, const FigurePointers& figures) {
  const FigurePointers within = With(Change::kWithin, figures), equal = With(Change::kEqual, figures);
  if (!within.empty())
    return comparing.Is("neither better nor worse") + comparing.than_first + ": " + FromTo(within) + ", within the spread.";
  return comparing.Is("as good as") + comparing.than_first.substr(std::string(" than").size()) + ": " +
         Join(equal, ", ", [](const auto* f) { return f->figure->label + (" " + FigureText(*f->figure, f->values.back())); }) +
         " in both.";
}

std::string SentenceOn(const Comparing& comparing, const FigurePointers& figures) {
  const FigurePointers better = With(Change::kBetter, figures), worse = With(Change::kWorse, figures);
  if (better.empty() && worse.empty()) return Undecided(comparing, figures);
  if (worse.empty()) return comparing.Is("better") + comparing.than_first + ": " + FromTo(better) + SpreadNote(better) + ".";
  if (better.empty()) return comparing.Is("worse") + comparing.than_first + ": " + FromTo(worse) + SpreadNote(worse) + ".";
  return comparing.Is("better in part and worse in part") + comparing.than_first + ": better in " + FromTo(better) +
         SpreadNote(better) + "; worse in " + FromTo(worse) + SpreadNote(worse) + ".";
}

std::string SentenceOf(const ComparedRuns& runs, const ComparedStage& stage, const Subject& subject,
                       const FigurePointers& figures) {
  const std::string where = stage.folder.empty() ? "" : " in " + stage.folder;
  const Comparing comparing{std::string("The ") + subject.name, " of " + runs.names.back() + where,
                            std::string(subject.plural ? " than those of " : " than that of ") + runs.names.front(),
                            subject.plural};
  FigurePointers known;
  std::copy_if(figures.begin(), figures.end(), std::back_inserter(known),
               [](const auto* f) { return f->change != Change::kNotCompared && f->change != Change::kOnlyOne; });
  if (!known.empty()) return SentenceOn(comparing, known);
  if (With(Change::kNotCompared, figures).empty()) return "";
  return std::string("Whether the ") + subject.name + comparing.of_last + (subject.plural ? " are better" : " is better") +
         comparing.than_first + " cannot be said: " + stage.why_not + ".";
}

}  // namespace

std::vector<std::string> JudgingSentences(const ComparedRuns& runs, const std::vector<ComparedStage>& stages,
                                          const std::vector<ComparedFigure>& figures) {
  std::vector<std::string> sentences;
  for (const Subject& subject : kSubjects) {
    for (const ComparedStage& stage : stages) {
      if (stage.command != subject.command || !stage.InBoth()) continue;
      FigurePointers main;
      for (const ComparedFigure& figure : figures) {
        if (figure.stage == &stage && figure.figure->main) main.push_back(&figure);
      }
      std::string sentence = SentenceOf(runs, stage, subject, main);
      if (!sentence.empty()) sentences.push_back(std::move(sentence));
    }
  }
  if (sentences.empty()) sentences.push_back("The runs have no result in common that could be compared.");
  return sentences;
}

}  // namespace mvstudio::report
