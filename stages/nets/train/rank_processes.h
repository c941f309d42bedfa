#pragma once

#include <memory>
#include <string>
#include <vector>

#include "avatar/train/train_ranks.h"
#include "core/disk/output.h"
#include "core/process.h"
#include "core/progress.h"
#include "stages/nets/train/options.h"

/// Several processes of this program that train one avatar together.
namespace mvstudio::stages {

struct RankArguments {
  int ranks = 1;  ///< processes to start here; 0 in `avatar resume`: as many as before
  int rank = 0, world_size = 1;
  std::string rendezvous;

  bool BySrun() const { return rendezvous == "slurm"; }
};

template <class Visitor>
void VisitFields(Visitor&& visit, RankArguments& a) {
  visit("ranks", a.ranks,
        "processes on this machine that take option 'batch' images each and share their gradients; as one process with a "
        "batch as many times as large");
  visit("rank", a.rank, "which process this is, from 0, when you start them yourself (several machines)");
  visit("world-size", a.world_size, "how many processes you start");
  VisitStyled(visit, OptionStyle::kUnset, "rendezvous", a.rendezvous,
              "a file that all of them can see; slurm: `srun` started them, and its variables tell option 'rank' and option "
              "'world-size'");
}

/// The processes that `arguments` ask for, with their files in `folder`. `typed`: the command line, program and all, which the
/// others get with their places.
RankOptions RanksOf(const RankArguments& arguments, const std::vector<std::string>& typed, const RunContext& run,
                    const std::string& folder);

/// The other ranks of this machine, which run the same command; those that still run are ended when this goes away.
class RankProcesses {
 public:
  /// Starts `arguments.ranks` - 1 processes that find each other by a file in `folder`; with one rank, or where the arguments
  /// say that someone else starts them, none.
  RankProcesses(const RankArguments& arguments, const std::vector<std::string>& typed, const RunContext& run,
                const std::string& folder);

  const avatar::RankPlace& place() const { return place_; }
  bool first() const { return place_.rank == 0; }
  /// Threads for each process of this machine.
  int threads() const { return threads_; }
  /// The connection; null for one process.
  std::shared_ptr<const avatar::Ranks> Join() const;
  /// Waits for them; throws IoError when one did not end well, which ends the rest.
  void Finish();

 private:
  void TakeSlurmStep(const std::string& folder);
  void StartOthers(const std::vector<std::string>& words, int ranks);

  const ProgressSink* progress_;
  std::unique_ptr<ScratchFolder> meeting_;  ///< where they find each other
  avatar::RankPlace place_;
  int threads_;
  Processes others_{ProcessGroup::kShared};  ///< Ctrl-C reaches all ranks
};

}  // namespace mvstudio::stages
