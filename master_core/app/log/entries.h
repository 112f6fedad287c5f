/** Entries of the intervention log about a start: which program, with which options, which plan. */
#ifndef FSN_APP_ENTRIES_H
#define FSN_APP_ENTRIES_H

#include "app/base/options.h"
#include "fsn/plan.h"

/** This program starts: version, hash of its file, host, process, user, words of its command line.
 */
void entry_start(int argc, char **argv);

/** The plan that was loaded: hash, fingerprint, cycle, and what it is accepted by. */
void entry_plan(const struct fsn_plan *plan, const struct options *options);

/** What was said when the signatures of an acceptance record were checked, lines of text. */
void entry_acceptance(const struct options *options, bool as_signed, const char *text);

#endif
