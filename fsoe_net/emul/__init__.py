"""FSoE devices living on an emulated bus; they know no core, only sync managers. Time is given."""
