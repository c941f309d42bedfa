#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>

#include "avatar/run/pack/training_set.h"
#include "avatar/settings/gaussian_options.h"
#include "avatar/settings/options.h"
#include "avatar/train/train_ranks.h"
#include "core/choice/option_style.h"
#include "stages/budget/ask.h"
#include "stages/nets/avatar_fit.h"
#include "stages/nets/avatar_train_data.h"

/// An avatar of a person of a dataset: what a caller gives.
namespace mvstudio::stages {

/// The processes that train one avatar together, seen from one of them. As it is: this one alone.
struct RankTeam {
  int rank = 0, size = 1;
  int threads = 0;  ///< of each process; 0: as many as the run has
  std::function<std::shared_ptr<const avatar::Ranks>()> join = {};
  std::function<void()> finish = {};  ///< waits for the others; throws IoError when one did not end well
  bool first() const { return rank == 0; }
};

/// Which of them this is, and how the others are started, which is once nothing can be refused any more for what was asked.
struct RankOptions {
  int rank = 0;
  /// `before`: how many trained a run that goes on, else 1. None: this process alone.
  std::function<RankTeam(int before)> start = {};
};

struct AvatarTrainOptions {
  AvatarTrainOptions() { model.prior = avatar::Prior::kAuto; }
  std::string dataset, out;  ///< folders: what is learned from, the run
  SplitArguments split;
  bool overwrite = false;
  std::string init_from;                    ///< a run whose network is the start; empty: none
  BodyFitMode fit = BodyFitMode::kAuto;     ///< the body that maps and labels show
  std::string body_template = "mannequin";  ///< as TemplatesOf takes it
  std::string body;                         ///< fitted already; empty: it is fitted
  avatar::ModelOptions model;
  avatar::TrainOptions train;
  avatar::GaussianOptions gaussians;
  avatar::TrainingSetOptions pack;
  BudgetOptions budget;

  std::set<std::string> given;  ///< names of the options that somebody chose
  bool relative_paths = false;  ///< the run's configuration names its inputs by paths from the run
  RankOptions ranks;

  bool Given(const std::string& name) const { return given.count(name) > 0; }
};

template <class Visitor>
void VisitFields(Visitor&& visit, AvatarTrainOptions& o) {
  StartGroup(visit, "Data");
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "folder of the run");
  VisitFields(visit, o.split);
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace an older run in option 'out'");
  StartGroup(visit, "Network");
  visit("init-from", o.init_from,
        "a run, or a folder of `avatar pretrain`, whose network is the start (its options hold, but for option 'method'); "
        "textures are averaged from the new images, and there is no initialisation unless option 'init-steps' asks for one");
  StartGroup(visit, "Body");
  VisitStyled(visit, OptionStyle::kUnset, "fit", o.fit,
              "body that maps and labels show: auto fits skeleton, surface and colours to the training images; girths scales "
              "the mannequin's four girths; off takes it as it is");
  VisitStyled(visit, OptionStyle::kUnset, "template", o.body_template,
              "body that option 'fit' auto takes, as in `avatar fit`: mannequin, a path, several, auto");
  visit("body", o.body,
        "body.npz of `avatar fit` or of another run, or its folder, in place of a new fit; it must have been fitted to "
        "training images of this split alone");
  VisitFields(visit, o.model);
  VisitFields(visit, o.train);
  VisitFields(visit, o.gaussians);
  VisitFields(visit, o.pack);
  VisitBudget(visit, o.budget,
              "SSIM on a camera that is not trained on that is enough, e.g. 0.85ssim: the cheapest of body, Gaussians and "
              "networks that a trial predicts to reach it");
}

/// A run that goes on.
struct AvatarResumeOptions {
  std::string run, device, perceptual;  ///< device, perceptual: empty: as asked for then
  int steps = -1, patience = -1;        ///< -1: as asked for then
  RankOptions ranks;
};

template <class Visitor>
void VisitFields(Visitor&& visit, AvatarResumeOptions& o) {
  VisitStyled(visit, OptionStyle::kUnset, "steps", o.steps,
              "end-to-end steps in all, counted from the beginning of the run; -1: as asked for then");
  visit("patience", o.patience, "checkpoints without a better score after which training ends; -1: as asked for then");
  visit("perceptual", o.perceptual,
        "the TorchScript file of the perceptual loss, where one was used: it is run, so a checkpoint alone cannot name it");
  visit("device", o.device, "auto, cpu or cuda; as asked for then unless given");
}

}  // namespace mvstudio::stages
