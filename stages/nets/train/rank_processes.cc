#include "stages/nets/train/rank_processes.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/parallel.h"
#include "stages/nets/train/slurm_step.h"

namespace mvstudio::stages {
namespace {

/// `words` without each of `flags` and its value.
std::vector<std::string> Without(const std::vector<std::string>& words, const std::vector<std::string>& flags) {
  std::vector<std::string> rest;
  for (size_t i = 0; i < words.size(); ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    if (std::find(flags.begin(), flags.end(), name) == flags.end()) {
      rest.push_back(words[i]);
    } else if (name == words[i]) {
      ++i;
    }
  }
  return rest;
}

/// srun's variables stand in for what was not typed.
RankArguments WithStep(RankArguments arguments) {
  if (!arguments.BySrun()) return arguments;
  if (arguments.ranks > 1 || arguments.rank != 0 || arguments.world_size != 1)
    throw UsageError(
        "option 'rendezvous' slurm takes ranks from `srun`: leave option 'ranks', option 'rank' and option "
        "'world-size' out");
  const SlurmStep step = ReadSlurmStep([](const char* name) -> const char* { return std::getenv(name); });
  arguments.ranks = 1, arguments.rank = step.rank, arguments.world_size = step.size;
  return arguments;
}

}  // namespace

RankOptions RanksOf(const RankArguments& given, const std::vector<std::string>& typed, const RunContext& run,
                    const std::string& folder) {
  const RankArguments arguments = WithStep(given);
  const auto start = [=](int before) {
    RankArguments asked = arguments;
    if (asked.ranks == 0) asked.ranks = asked.world_size > 1 || asked.rank > 0 ? 1 : before;
    const auto ranks = std::make_shared<RankProcesses>(asked, typed, run, folder);
    return RankTeam{ranks->place().rank, ranks->place().size, ranks->threads(), [ranks] { return ranks->Join(); },
                    [ranks] { ranks->Finish(); }};
  };
  return {arguments.rank, start};
}

RankProcesses::RankProcesses(const RankArguments& a, const std::vector<std::string>& typed, const RunContext& run,
                             const std::string& folder)
    : progress_(run.progress), threads_(run.num_threads) {
  if (a.ranks < 1 || a.ranks > 256 || a.world_size < 1)
    throw UsageError("option 'ranks' and option 'world-size' must be at least 1");
  if (a.ranks > 1 && (a.world_size > 1 || a.rank > 0 || !a.rendezvous.empty()))
    throw UsageError(
        "option 'ranks' starts the processes itself: leave option 'rank', option 'world-size' and option 'rendezvous' out");
  place_ = {a.rank, a.world_size, a.rendezvous, false, {}};
  if (a.ranks == 1) {
    if (a.world_size == 1 && a.rank != 0)
      throw UsageError("option 'rank' " + std::to_string(a.rank) + " needs option 'world-size'");
    place_.one_machine = a.rendezvous.rfind("local:", 0) == 0;
    if (place_.one_machine) place_.rendezvous = a.rendezvous.substr(6);
    if (a.BySrun()) TakeSlurmStep(folder);
    return;
  }
  meeting_ = std::make_unique<ScratchFolder>(folder);
  place_ = {0, a.ranks, meeting_->path() + "/ranks", true, {}};
  threads_ = std::max(1, ResolveThreads(run.num_threads) / a.ranks);
  StartOthers(Without(typed, {"--ranks", "--threads", "--progress"}), a.ranks);
}

void RankProcesses::TakeSlurmStep(const std::string& folder) {
  const SlurmStep step = ReadSlurmStep([](const char* name) -> const char* { return std::getenv(name); });
  place_.rendezvous = MeetingBeside(folder, step), place_.one_machine = step.one_machine;
  MakeFolder(std::filesystem::path(place_.rendezvous).parent_path().string());
  if (threads_ == 0) threads_ = step.threads;
}

void RankProcesses::StartOthers(const std::vector<std::string>& words, int ranks) {
  for (int rank = 1; rank < ranks; ++rank) {
    std::vector<std::string> child = words;
    child.front() = kThisProgram;
    for (const std::string& word :
         {std::string("--rank"), std::to_string(rank), std::string("--world-size"), std::to_string(ranks),
          std::string("--rendezvous"), "local:" + place_.rendezvous, std::string("--threads"), std::to_string(threads_),
          std::string("--progress"), std::string("none")})
      child.push_back(word);
    ProcessFiles files;
    files.out = "/dev/null";  // only the first rank reports
    files.share_err = true;
    try {
      others_.Start(child, files);
    } catch (const IoError& error) {
      throw ResourceError(std::string("cannot start another rank: ") + error.what());
    }
  }
}

std::shared_ptr<const avatar::Ranks> RankProcesses::Join() const {
  if (place_.size == 1) return nullptr;
  avatar::RankPlace place = place_;
  place.while_waiting = [this] {
    if (progress_ && progress_->Cancelled()) throw CancelledError("interrupted before the other ranks were there");
    if (others_.AnyEnded()) throw IoError("option 'ranks'", "another rank ended before training began; see its message above");
  };
  return avatar::JoinRanks(place);
}

void RankProcesses::Finish() {
  const std::vector<int> exits = others_.Wait();
  const auto failed = std::count_if(exits.begin(), exits.end(), [](int exit) { return exit > 0; });
  if (failed > 0)
    throw IoError("option 'ranks'", std::to_string(failed) + " of the other ranks did not end well; see their messages above");
}

}  // namespace mvstudio::stages
